#pragma once

#include <string>
#include <vector>

namespace mapmend {

// The candidate that a misspelt word was meant to be; empty if none is near.
std::string NearestWord(const std::string& word, const std::vector<std::string>& candidates);

}  // namespace mapmend
