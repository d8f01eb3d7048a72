#pragma once

#include <cstdint>
#include <string>
#include <vector>

namespace mapmend {

struct CaptureTimes {
  std::vector<int64_t> utimes;  // one for each photo, growing; empty if the photos do not tell them
  std::string why_not;          // one line then; empty if no photo has a capture time at all
};

// When photos were taken, from their EXIF tags DateTimeOriginal, SubSecTimeOriginal and OffsetTimeOriginal;
// microseconds, read as UTC where no offset is told. Cameras without parts of seconds give several photos one time:
// these are spread evenly over that second. All photos must have a time, and the times must grow in the given order.
CaptureTimes ReadCaptureTimes(const std::vector<std::string>& files);

}  // namespace mapmend
