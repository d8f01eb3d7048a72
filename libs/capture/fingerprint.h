#pragma once

#include <string>
#include <vector>

namespace mapmend {

// A text that tells the content of a flight's files apart from that of others: the size of each file in the order in
// which they are read, and a checksum of its first and last bytes. Names do not count: folders are called alike
// everywhere, and a copy is the same flight. Throws std::runtime_error as listing the images does.
std::string ContentFingerprint(const std::vector<std::string>& inputs);

}  // namespace mapmend
