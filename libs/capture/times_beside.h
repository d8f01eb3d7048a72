#pragma once

#include <string>
#include <vector>

namespace mapmend {

struct TimesBeside {
  std::string path;  // empty: there is none that can be meant
  std::string note;  // why not, for the user; empty if there is none
};

// times.txt in the folder of images, or beside the video. Where other videos lie beside it too, nobody knows whose
// times they are: then none is taken.
TimesBeside FindTimesBeside(const std::vector<std::string>& inputs);

}  // namespace mapmend
