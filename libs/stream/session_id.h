#pragma once

#include <string>

namespace mapmend {

// A session's UUID (version 8, RFC 9562) from a text that describes its input and options: the same flight mapped again
// has the same name, so that two runs can be compared bit for bit.
std::string SessionIdFromText(const std::string& text);

// A UUID that nothing else has. Throws std::runtime_error with one line if the kernel gives none.
std::string NewSessionId();

}  // namespace mapmend
