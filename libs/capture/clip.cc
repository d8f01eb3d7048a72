#include "libs/capture/clip.h"

#include <algorithm>
#include <filesystem>
#include <map>
#include <opencv2/core.hpp>
#include <set>
#include <stdexcept>
#include <utility>

#include "libs/capture/exif_time.h"
#include "libs/capture/image_list.h"
#include "libs/capture/video_reader.h"
#include "libs/geometry/times_file.h"

namespace mapmend {
namespace {

namespace fs = std::filesystem;

class VideoClip : public Clip {
 public:
  explicit VideoClip(const std::string& path) : reader_(path) {
    const VideoInfo& info = reader_.Info();
    facts_ = {path, info.fps, info.num_frames, info.frames_hint, info.has_times, false, true, info.creation_utime,
              {},   {}};
    if (!info.track_note.empty()) facts_.notes.push_back(info.track_note);
    // A container without one picture in it is found out here, not by the frontend.
    has_first_ = reader_.Grab();
    if (!has_first_) throw std::runtime_error("input " + path + ": the video holds no frame that can be decoded");
  }
  bool Grab() override {
    if (!std::exchange(has_first_, false) && !reader_.Grab()) return false;
    ++index_;
    return true;
  }
  DecodedImage Decode() override {
    if (reader_.IsDamaged()) return {nullptr, "is damaged"};
    auto pixels = std::make_shared<cv::Mat>(reader_.Pixels());
    if (pixels->empty()) return {nullptr, "cannot be converted"};
    return {pixels, ""};
  }
  std::optional<int64_t> Utime() const override { return reader_.Utime(); }
  std::string FrameName() const override {
    return fs::path(facts_.name).filename().string() + ", frame " + std::to_string(index_);
  }
  std::string Cut() const override { return reader_.Cut(); }
  std::string Missing() const override {
    const int count = reader_.NumDamaged();
    if (count == 0) return {};
    return std::to_string(count) + (count == 1 ? " piece" : " pieces") + " of it cannot be decoded";
  }
  std::pair<int, int> UsualSize() const override { return {reader_.Info().width, reader_.Info().height}; }

 private:
  VideoReader reader_;
  bool has_first_ = false;
  int index_ = -1;
};

class ImagesClip : public Clip {
 public:
  ImagesClip(const std::string& name, ImageList list) : files_(std::move(list.files)) {
    const int count = static_cast<int>(files_.size());
    facts_ = {name, 0, count, count, false, false, false, std::nullopt, std::move(list.notes), {}};
    if (const auto times = TimesOfNames(files_)) {
      SetTimes(times->utimes, "times from the names of the images");
      return;
    }
    CaptureTimes times = ReadCaptureTimes(files_);
    if (!times.utimes.empty()) {
      SetTimes(std::move(times.utimes), "times from the capture times of the photos (EXIF)");
    } else if (!times.why_not.empty()) {
      facts_.notes.push_back(times.why_not + ": capture times are not used");
    }
  }
  bool Grab() override { return ++index_ < static_cast<int>(files_.size()); }
  DecodedImage Decode() override { return ReadImageFile(files_[static_cast<size_t>(index_)]); }
  std::optional<int64_t> Utime() const override {
    return utimes_.empty() ? std::nullopt : std::optional(utimes_[static_cast<size_t>(index_)]);
  }
  std::string FrameName() const override { return files_[static_cast<size_t>(index_)]; }
  std::pair<int, int> UsualSize() const override {
    constexpr size_t kProbed = 5;
    std::set<size_t> probes;
    for (size_t i = 0; i < kProbed; ++i) probes.insert(i * (files_.size() - 1) / (kProbed - 1));
    std::map<std::pair<int, int>, int> votes;
    std::pair<int, int> best = {0, 0};
    const auto look = [&](size_t i) {
      const DecodedImage image = ReadImageFile(files_[i]);
      if (!image.pixels) return;
      const std::pair size(image.pixels->cols, image.pixels->rows);
      if (++votes[size] > votes[best]) best = size;
    };
    for (const size_t i : probes) look(i);
    for (size_t i = 0; i < files_.size() && votes.empty(); ++i) look(i);
    return best;
  }

 private:
  void SetTimes(std::vector<int64_t> utimes, const std::string& whence) {
    utimes_ = std::move(utimes);
    facts_.has_times = facts_.times_are_utc = true;
    facts_.times_note = whence;
  }

  std::vector<std::string> files_;
  std::vector<int64_t> utimes_;
  int index_ = -1;
};

}  // namespace

std::unique_ptr<Clip> OpenVideoClip(const std::string& path) { return std::make_unique<VideoClip>(path); }

std::unique_ptr<Clip> OpenFolderClip(const std::string& folder) {
  return std::make_unique<ImagesClip>(folder, ListImages(folder));
}

std::unique_ptr<Clip> OpenImagesClip(const std::vector<std::string>& files) {
  return std::make_unique<ImagesClip>(files.front(), SortImages(files));
}

}  // namespace mapmend
