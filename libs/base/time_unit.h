#pragma once

#include <cstdint>
#include <string>
#include <string_view>
#include <vector>

// Times as text, and the unit they are in, which most files do not say.
namespace mapmend {

// The value is the power of 1000 by which a second is divided.
enum class TimeUnit { kSeconds = 0, kMilliseconds = 1, kMicroseconds = 2, kNanoseconds = 3 };

const char* NameOf(TimeUnit unit);  // "seconds" ...

// A decimal number ("1525003606.0", "1.5250036060e9") of that unit to microseconds, rounded half away from zero. Exact:
// the decimal text is shifted, never passed through a double. False if the text is not a number or does not fit.
bool ParseTime(std::string_view text, TimeUnit unit, int64_t* utime);
inline bool ParseSeconds(std::string_view text, int64_t* utime) { return ParseTime(text, TimeUnit::kSeconds, utime); }

// The unit of times that follow each other, as decimal numbers (at least one).
//   head  what the file says about the column ("#timestamp [ns]"): decides if it names a unit
// Otherwise the unit in which they are times of our days (1990 to 2100) with less than ten minutes from frame to frame;
// otherwise, for clocks that start at zero, the one in which frames follow each other as those of cameras do: decimals
// are seconds, whole numbers may be photos up to 15 s apart (1 2 3 ...), else milliseconds, microseconds, nanoseconds.
TimeUnit GuessTimeUnit(const std::vector<std::string>& times, const std::string& head);

}  // namespace mapmend
