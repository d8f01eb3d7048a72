#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "libs/base/time_unit.h"

// The times of a flight's frames, from a file or from the names of the images. The one reader for counting and reading.
namespace mapmend {

struct FrameTimes {
  std::vector<int64_t> utimes;     // growing (but for a few, with NotGrowing::kKeepFew)
  std::vector<std::string> names;  // of the images beside the times ("data.csv" of EuRoC), one each; empty without
  TimeUnit unit = TimeUnit::kSeconds;
  std::string note;  // one line for the user if the file was not plainly one column of seconds; else empty
};

// What is made of a time that is not later than the one before: an error, or, of up to a twentieth of the lines of a
// file with ten or more, one that is kept for the caller to leave its frame out.
enum class NotGrowing { kRefuse, kKeepFew };

// One time a line, in seconds, milliseconds, microseconds or nanoseconds (see GuessTimeUnit). Further columns, a column
// that counts the frames, and names of images are told apart. ReadTextTable says what is no data.
// Throws std::runtime_error with one line that names the file and the line: what is not a number, has a decimal comma,
// is not later than the time before, is of another unit; or no time at all.
FrameTimes ReadFrameTimes(const std::string& path, NotGrowing not_growing = NotGrowing::kRefuse);

// Names that are times, as of TUM ("1305031102.175304.png") or EuRoC ("1403636579763555584.png"); nothing if they are
// not all times of our days, growing.
std::optional<FrameTimes> TimesOfNames(const std::vector<std::string>& names);

}  // namespace mapmend
