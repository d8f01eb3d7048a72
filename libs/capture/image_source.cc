#include "libs/capture/image_source.h"

#include <algorithm>
#include <cmath>
#include <filesystem>
#include <fstream>
#include <opencv2/core.hpp>
#include <sstream>
#include <stdexcept>

#include "libs/capture/image_list.h"
#include "libs/geometry/times_file.h"

namespace mapmend {
namespace {

namespace fs = std::filesystem;

constexpr double kDefaultFps = 30;
constexpr int kNewTimeBase = 3;  // frames in a row that confirm that a clip's clock was set back

double FpsOf(const Clip& clip, double camera_fps) {
  const Clip::Facts& facts = clip.GetFacts();
  // Whoever calibrated the camera knows better than a stream of pictures without any times.
  if (facts.is_video && !facts.has_times && camera_fps > 0) return camera_fps;
  return facts.fps > 0 ? facts.fps : camera_fps > 0 ? camera_fps : kDefaultFps;
}

std::string SizeText(int width, int height) { return std::to_string(width) + " x " + std::to_string(height); }

std::string Number(double value) {
  std::ostringstream text;
  text << value;
  return text.str();
}

std::string Count(int count, const char* what) { return std::to_string(count) + " " + what + (count == 1 ? "" : "s"); }

}  // namespace

ImageSource::ImageSource(const SourceOptions& options) : options_(options) {
  OpenClips();
  for (const auto& clip : clips_) {
    for (const std::string& note : clip->GetFacts().notes) notes_.push_back(note);
    all_counted_ = all_counted_ && clip->GetFacts().num_frames > 0;
  }
  CheckTimes();
  CountFrames();
  TellTimes();
}

ImageSource::~ImageSource() = default;

void ImageSource::OpenClips() {
  std::error_code error;
  for (const std::string& input : options_.inputs) {
    if (!fs::exists(input, error)) throw std::runtime_error("input " + input + " does not exist");
  }
  if (options_.open_other) {
    if (auto clip = options_.open_other(options_.inputs)) {
      clips_.push_back(std::move(clip));
      return;
    }
  }
  std::vector<std::string> images;
  for (const std::string& input : options_.inputs) {
    if (fs::is_directory(input, error)) {
      clips_.push_back(OpenFolderClip(input));
    } else if (HasImageName(input)) {
      images.push_back(input);
    } else {
      clips_.push_back(OpenVideoClip(input));
    }
  }
  if (!images.empty() && !clips_.empty())
    throw std::runtime_error("input " + images.front() + ": single images and videos or folders do not go together");
  if (!images.empty()) clips_.push_back(OpenImagesClip(images));
  if (clips_.empty()) throw std::runtime_error("no input: give a video file or a folder of images");
}

void ImageSource::CheckTimes() {
  if (options_.times_path.empty()) return;
  FrameTimes times = ReadFrameTimes(options_.times_path, NotGrowing::kKeepFew);
  if (!times.note.empty()) notes_.push_back(times.note);
  times_ = std::move(times.utimes);
  int counted = 0;
  for (const auto& clip : clips_) counted += clip->GetFacts().num_frames;
  const int given = static_cast<int>(times_.size());
  const std::string says =
      "times file " + options_.times_path + " has " + Count(given, "line") + " for " + Count(counted, "frame");
  // Of images that lie in a folder each has its line, or some were deleted and all lines behind belong to others.
  const bool has_images =
      std::any_of(clips_.begin(), clips_.end(), [](const auto& c) { return !c->GetFacts().is_video; });
  if (all_counted_ ? given < counted || (given > counted && has_images) : given < counted)
    throw std::runtime_error(says + "; it needs one for each");
  if (all_counted_ && given > counted) notes_.push_back(says + ": is it that of another flight?");
}

void ImageSource::CountFrames() {
  int total = 0;
  double duration = 0;
  for (const auto& clip : clips_) {
    total += clip->GetFacts().frames_hint;
    duration += clip->GetFacts().frames_hint / FpsOf(*clip, options_.camera_fps);
  }
  const bool is_window = options_.start_s > 0 || std::isfinite(options_.end_s);
  if (times_.empty() && is_window) {
    const double share = (std::min(options_.end_s, duration) - options_.start_s) / std::max(duration, 1e-6);
    frames_hint_ = static_cast<int>(std::clamp(share, 0.0, 1.0) * total) / options_.every;
    return;
  }
  if (!times_.empty() && !all_counted_) total = static_cast<int>(times_.size());
  for (int i = 0; i < total; ++i) {
    const double seconds = times_.empty() ? 0 : static_cast<double>(times_[static_cast<size_t>(i)] - times_[0]) * 1e-6;
    frames_hint_ += i % options_.every == 0 && !options_.skip.contains(i) &&
                    (times_.empty() || (seconds >= options_.start_s && seconds < options_.end_s));
  }
  if (all_counted_) num_frames_ = frames_hint_;
}

void ImageSource::TellTimes() {
  if (!times_.empty()) return;
  for (const auto& clip : clips_) {
    const Clip::Facts& facts = clip->GetFacts();
    if (!facts.times_note.empty()) notes_.push_back(facts.times_note);
    if (!facts.has_times) {
      notes_.push_back(facts.name + " has no times: " + Number(FpsOf(*clip, options_.camera_fps)) +
                       " frames a second are assumed (--times gives others)");
    }
  }
}

std::pair<int, int> ImageSource::UsualSize() const {
  for (const auto& clip : clips_) {
    if (const auto size = clip->UsualSize(); size.first > 0) return size;
  }
  return {0, 0};
}

void ImageSource::BeginClip() {
  index_in_clip_ = -1;
  if (clip_ == clips_.size() || !last_utime_) return;
  // One file after the other, as cameras split a flight, unless their clocks say that the camera was off in between.
  const Clip::Facts& first = clips_.front()->GetFacts();
  const Clip::Facts& facts = clips_[clip_]->GetFacts();
  clip_begin_ = *last_utime_ + std::max<int64_t>(last_step_, 1);
  constexpr int64_t kClockResolution = 2000000;
  if (first.creation_utime && facts.creation_utime) {
    const int64_t begin = *facts.creation_utime - *first.creation_utime;
    if (begin > clip_begin_ + kClockResolution) clip_begin_ = begin;
  }
}

bool ImageSource::GrabNext() {
  while (clip_ < clips_.size()) {
    if (clips_[clip_]->Grab()) {
      ++index_;
      ++index_in_clip_;
      return true;
    }
    const Clip::Facts& facts = clips_[clip_]->GetFacts();
    if (const std::string cut = clips_[clip_]->Cut(); !cut.empty()) {
      const int announced = facts.num_frames > 0 ? facts.num_frames : facts.frames_hint;
      Miss("input " + facts.name + ": ends after " + std::to_string(index_in_clip_ + 1) +
           (announced > index_in_clip_ + 1 ? " of " + std::to_string(announced) : "") + " frames; " + cut);
    }
    if (const std::string missing = clips_[clip_]->Missing(); !missing.empty())
      Miss("input " + facts.name + ": " + missing);
    ++clip_;
    BeginClip();
  }
  return false;
}

void ImageSource::Miss(const std::string& why) {
  const std::lock_guard lock(mutex_);
  if (missing_.empty()) missing_ = why;
}

void ImageSource::Refuse(const std::string& why) { left_out_.Add(clips_[clip_]->FrameName() + " " + why); }

std::optional<int64_t> ImageSource::TimeOfFrame() {
  const Clip& clip = *clips_[clip_];
  std::optional<int64_t> utime;
  if (!times_.empty()) {
    utime = times_[static_cast<size_t>(index_)];
  } else if (const auto own = clip.Utime()) {
    utime = *own + (clip.GetFacts().times_are_utc ? 0 : clip_begin_);
  } else if (clip.GetFacts().has_times && last_utime_) {
    utime = *last_utime_ + std::max<int64_t>(last_step_, 1);  // a gap in a container's times
  } else {
    utime = clip_begin_ + std::llround(index_in_clip_ * 1e6 / FpsOf(clip, options_.camera_fps));
  }
  if (last_utime_ && *utime <= *last_utime_) {
    if (++num_back_ < kNewTimeBase || !times_.empty() || clip.GetFacts().times_are_utc) return std::nullopt;
    // Joined from pieces that each begin at 0: from here on counted from the last frame before.
    clip_begin_ += *last_utime_ + kNewTimeBase * std::max<int64_t>(last_step_, 1) - *utime;
    utime = *last_utime_ + kNewTimeBase * std::max<int64_t>(last_step_, 1);
  }
  num_back_ = 0;
  if (last_utime_) last_step_ = *utime - *last_utime_;
  last_utime_ = utime;
  if (!first_utime_) first_utime_ = utime;
  return utime;
}

void ImageSource::EndOfInput() {
  const int num_frames = index_ + 1;
  if (static_cast<int>(times_.size()) > num_frames && std::isinf(options_.end_s)) {
    Miss("times file " + options_.times_path + " has " + Count(static_cast<int>(times_.size()), "line") +
         ", the input only " + Count(num_frames, "frame"));
  }
  if (num_given_ == 0 && left_out_.Count() > 0) {
    throw std::runtime_error("input " + options_.inputs.front() + ": none of its " + Count(num_frames, "frame") +
                             " could be used; " + left_out_.Sentences().front());
  }
}

std::optional<SourceImage> ImageSource::Next() {
  if (options_.width == 0) std::tie(options_.width, options_.height) = UsualSize();
  while (true) {
    if (!GrabNext()) {
      EndOfInput();
      return std::nullopt;
    }
    if (!times_.empty() && index_ >= static_cast<int>(times_.size())) {
      Miss("times file " + options_.times_path + " has " + Count(static_cast<int>(times_.size()), "line") + "; frame " +
           std::to_string(index_) + " and those behind it have none");
      return std::nullopt;
    }
    const auto utime = TimeOfFrame();
    if (!utime) {
      Refuse("has a time that is not later than that of the frame before");
      continue;
    }
    const double seconds = static_cast<double>(*utime - *first_utime_) * 1e-6;
    if (seconds >= options_.end_s) return std::nullopt;
    if (seconds < options_.start_s || index_ % options_.every != 0 || options_.skip.contains(index_)) continue;
    DecodedImage image = clips_[clip_]->Decode();
    if (!image.pixels) {
      Refuse(image.problem);
      continue;
    }
    if (image.pixels->cols != options_.width || image.pixels->rows != options_.height) {
      Refuse("has " + SizeText(image.pixels->cols, image.pixels->rows) + " pixels, the flight " +
             SizeText(options_.width, options_.height));
      continue;
    }
    ++num_given_;
    return SourceImage{index_, *utime, std::make_shared<cv::Mat>(range_.To8Bit(*image.pixels)), std::move(image.jpeg)};
  }
}

std::string ImageSource::Problem() const {
  std::string text;
  {
    const std::lock_guard lock(mutex_);
    text = missing_;
  }
  const int count = left_out_.Count();
  if (count == 0) return text;
  constexpr size_t kNamed = 3;
  const std::vector<std::string> sentences = left_out_.Sentences();
  if (!text.empty()) text += "; ";
  text += (text.empty() ? "input " + options_.inputs.front() + ": " : "") + Count(count, "frame") +
          (count == 1 ? " was" : " were") + " left out: ";
  for (size_t i = 0; i < std::min(kNamed, sentences.size()); ++i) text += (i > 0 ? ", " : "") + sentences[i];
  if (sentences.size() > kNamed) text += ", ...";
  return text;
}

}  // namespace mapmend
