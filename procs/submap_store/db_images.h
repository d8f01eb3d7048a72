#pragma once

#include <string>
#include <vector>

namespace mapmend {

// What the tools of `mapmend db` do with the images beside a database (ImagePathFor). A database without such a file is
// a good one.

// One line for each thing that is wrong with the images, those that are of no keyframe of the database included.
std::vector<std::string> CheckImages(const std::string& database);
// How many keyframes have an image, and how large they are: one line.
std::string DescribeImages(const std::string& database);
struct ImageTotals {
  int stored = 0, missing = 0;  // of keyframes that were not culled
  long long bytes = 0;          // of those stored
};
ImageTotals CountImages(const std::string& database);
// Removes images of keyframes that were culled or are not in the database, and what is damaged, and gives back the
// space.
void CompactImages(const std::string& database);
// Puts the images of databases into the file beside another one. Returns how many. What is damaged is left out.
int MergeImages(const std::vector<std::string>& databases, const std::string& out);

}  // namespace mapmend
