#pragma once

namespace mapmend {

// Takes back what SIGINT or SIGTERM asked for: StopRequested (libs/bus/process.h) is false until the next signal. For a
// run in which the first Ctrl-C means "land", and only the second "leave all at once".
void WithdrawStopRequest();

}  // namespace mapmend
