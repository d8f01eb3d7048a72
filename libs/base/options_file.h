#pragma once

#include <string>
#include <vector>

#include "libs/base/options.h"

namespace mapmend {

// One line of a file of options.
struct OptionLine {
  std::string name;       // dotted; the groups around it included
  std::string text;       // as Option::Set takes it
  bool is_empty = false;  // "name:" and nothing more: a group all of whose options are left out
  int line = 0;           // from 1
};

// Reads a file of options in YAML: groups as maps, or dotted names, or both; a list is a sequence.
//   tracker:
//     min_inliers: 30
//   refinement.final_map.radii: [16, 8, 5]
// Throws OptionError with one line that names the file, and the line, if it cannot be read, is no such YAML, or names
// an option twice.
std::vector<OptionLine> ReadOptionsFile(const std::string& path);

// "FILE:LINE: ", how complaints about one of them begin.
std::string PlaceOf(const std::string& path, const OptionLine& line);

}  // namespace mapmend
