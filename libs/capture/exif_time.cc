#include "libs/capture/exif_time.h"

#include <chrono>
#include <cstdio>
#include <exiv2/exiv2.hpp>
#include <filesystem>
#include <optional>

namespace mapmend {
namespace {

constexpr int64_t kSecond = 1000000;

struct Stamp {
  int64_t utime = 0;
  bool has_fraction = false;
};

std::string TagOf(const Exiv2::ExifData& tags, const char* key) {
  const auto found = tags.findKey(Exiv2::ExifKey(key));
  return found == tags.end() ? "" : found->toString();
}

// "2018:04:29 12:33:26"
std::optional<int64_t> ParseDateTime(const std::string& text) {
  int year = 0, month = 0, day = 0, hour = 0, minute = 0, second = 0;
  if (std::sscanf(text.c_str(), "%d:%d:%d %d:%d:%d", &year, &month, &day, &hour, &minute, &second) != 6)
    return std::nullopt;
  const std::chrono::year_month_day date{std::chrono::year(year), std::chrono::month(static_cast<unsigned>(month)),
                                         std::chrono::day(static_cast<unsigned>(day))};
  if (!date.ok() || year < 1970 || hour < 0 || hour > 23 || minute < 0 || minute > 59 || second < 0 || second > 60)
    return std::nullopt;
  const int64_t days = std::chrono::sys_days(date).time_since_epoch().count();
  return (((days * 24 + hour) * 60 + minute) * 60 + second) * kSecond;
}

std::optional<Stamp> ReadStamp(const std::string& file) {
  try {
    const auto image = Exiv2::ImageFactory::open(file);
    image->readMetadata();
    const Exiv2::ExifData& tags = image->exifData();
    const auto utime = ParseDateTime(TagOf(tags, "Exif.Photo.DateTimeOriginal"));
    if (!utime) return std::nullopt;
    Stamp stamp{*utime};
    int64_t unit = kSecond;
    for (const char digit : TagOf(tags, "Exif.Photo.SubSecTimeOriginal")) {
      if (digit < '0' || digit > '9' || unit == 1) break;
      unit /= 10;
      stamp.utime += (digit - '0') * unit;
      stamp.has_fraction = true;
    }
    char sign = 0;
    int hours = 0, minutes = 0;
    if (std::sscanf(TagOf(tags, "Exif.Photo.OffsetTimeOriginal").c_str(), "%c%d:%d", &sign, &hours, &minutes) == 3 &&
        (sign == '+' || sign == '-')) {
      stamp.utime -= (sign == '+' ? 1 : -1) * (hours * 60 + minutes) * 60 * kSecond;
    }
    return stamp;
  } catch (const std::exception&) {  // unreadable, or of a format without such tags
    return std::nullopt;
  }
}

// Photos i to end have the same time, of whole seconds.
void SpreadOverSecond(size_t begin, size_t end, std::vector<int64_t>* utimes) {
  for (size_t i = begin; i < end; ++i)
    (*utimes)[i] += static_cast<int64_t>(i - begin) * kSecond / static_cast<int64_t>(end - begin);
}

}  // namespace

CaptureTimes ReadCaptureTimes(const std::vector<std::string>& files) {
  Exiv2::LogMsg::setLevel(Exiv2::LogMsg::mute);
  std::vector<int64_t> utimes;
  std::vector<bool> has_fraction;
  size_t num_missing = 0;
  for (const std::string& file : files) {
    const auto stamp = ReadStamp(file);
    if (!stamp) {
      // The first few tell whether it is worth the time to open all of them.
      constexpr size_t kProbed = 20;
      if (++num_missing >= kProbed && utimes.empty()) return {};
      continue;
    }
    utimes.push_back(stamp->utime);
    has_fraction.push_back(stamp->has_fraction);
  }
  if (utimes.empty()) return {};
  if (num_missing > 0)
    return {{}, std::to_string(num_missing) + " of " + std::to_string(files.size()) + " photos tell no capture time"};
  for (size_t begin = 0; begin < utimes.size();) {
    size_t end = begin + 1;
    while (end < utimes.size() && utimes[end] == utimes[begin] && !has_fraction[end]) ++end;
    if (!has_fraction[begin]) SpreadOverSecond(begin, end, &utimes);
    begin = end;
  }
  for (size_t i = 1; i < utimes.size(); ++i) {
    if (utimes[i] <= utimes[i - 1]) {
      return {{},
              "the capture time of " + std::filesystem::path(files[i]).filename().string() +
                  " is not later than that of the photo before it"};
    }
  }
  return {utimes, ""};
}

}  // namespace mapmend
