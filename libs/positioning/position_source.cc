#include "libs/positioning/position_source.h"

#include <algorithm>
#include <filesystem>
#include <optional>
#include <stdexcept>
#include <utility>

#include "libs/positioning/exif_positions.h"

namespace mapmend {
namespace {

namespace fs = std::filesystem;

// "flight.SRT" beside "flight.MP4".
std::string FindSubtitles(const std::vector<std::string>& inputs) {
  if (inputs.size() != 1) return "";
  std::error_code error;
  for (const char* ending : {".SRT", ".srt"}) {
    const fs::path path = fs::path(inputs.front()).replace_extension(ending);
    if (fs::is_regular_file(path, error)) return path.string();
  }
  return "";
}

}  // namespace

PositionSource PositionSource::Open(const std::string& path, const std::string& origin,
                                    const std::vector<std::string>& inputs, const std::vector<std::string>& images) {
  PositionSource source;
  if (path == "none") return source;
  std::optional<Geodetic> enu_origin;
  if (!origin.empty()) enu_origin = ParseGeodetic(origin, "--gps-origin");
  if (!path.empty() && path != "exif") {
    source.Assign(ReadPositions(path, enu_origin), path, images);
    return source;
  }
  if (!images.empty()) source.ReadPhotos(images);
  if (path == "exif" && source.IsEmpty())
    throw std::runtime_error(images.empty() ? "--gps exif: the input is no folder of photos"
                                            : "--gps exif: none of the first photos tells where it was taken");
  if (!path.empty() || !images.empty()) return source;
  // What lies beside a video may be anything: it is taken only if it tells positions.
  if (const std::string subtitles = FindSubtitles(inputs); !subtitles.empty()) {
    try {
      source.Assign(ReadPositions(subtitles), subtitles, images);
      source.note_ += " (found beside the video)";
    } catch (const std::runtime_error&) {
    }
  }
  return source;
}

void PositionSource::ReadPhotos(const std::vector<std::string>& images) {
  const auto fixes = ReadExifPositions(images);
  for (size_t i = 0; i < fixes.size(); ++i) {
    if (fixes[i]) by_frame_[static_cast<int>(i)] = *fixes[i];
  }
  if (!by_frame_.empty())
    note_ = "positions: from the EXIF of the photos (" + std::to_string(by_frame_.size()) + " of " +
            std::to_string(images.size()) + " tell theirs; --gps none leaves them out)";
}

void PositionSource::Assign(const PositionFile& file, const std::string& path, const std::vector<std::string>& images) {
  path_ = path;
  note_ = "positions " + path + ": " + DescribePositions(file);
  std::map<std::string, int> index;
  for (size_t i = 0; i < images.size(); ++i) index[fs::path(images[i]).filename().string()] = static_cast<int>(i);
  for (size_t i = 0; i < file.names.size(); ++i) {
    const auto it = index.find(file.names[i]);
    if (it != index.end()) by_frame_[it->second] = file.fixes[i];
  }
  if (file.has_times && 2 * by_frame_.size() < file.fixes.size()) {
    by_frame_.clear();
    by_time_ = file.fixes;
    since_first_frame_ = file.since_first_frame;
    return;
  }
  if (!by_frame_.empty()) return;
  throw std::runtime_error("positions " + path + ": tells names of images and no times, and " +
                           (images.empty() ? "the input is a video" : "no image of the input has such a name"));
}

std::vector<PositionFix> PositionSource::TakeUntil(int64_t utime) {
  std::vector<PositionFix> taken;
  for (; next_ < by_time_.size() && by_time_[next_].utime <= utime; ++next_) {
    if (by_time_[next_].utime > passed_) taken.push_back(by_time_[next_]);
  }
  return taken;
}

std::vector<PositionFix> PositionSource::TakeFor(int frame, int64_t utime) {
  if (std::exchange(since_first_frame_, false)) {
    for (PositionFix& fix : by_time_) fix.utime += utime;
  }
  std::vector<PositionFix> taken = TakeUntil(utime);
  const auto it = by_frame_.find(frame);
  if (it == by_frame_.end()) return taken;
  taken.push_back(it->second);
  taken.back().utime = utime;
  by_frame_.erase(it);
  return taken;
}

std::vector<PositionFix> PositionSource::TakeRest() { return TakeUntil(INT64_MAX); }

void PositionSource::PassOver(int64_t utime) { passed_ = utime; }

}  // namespace mapmend
