#pragma once

#include <string>
#include <vector>

namespace mapmend {

// IPv4 addresses under which other machines reach this one, in the kernel's order; without loopback.
std::vector<std::string> LanAddresses();

}  // namespace mapmend
