#pragma once

namespace mapmend {

// Exit code of a process that must not be started again: what it needs is gone (EX_IOERR of sysexits.h).
inline constexpr int kExitForGood = 74;

}  // namespace mapmend
