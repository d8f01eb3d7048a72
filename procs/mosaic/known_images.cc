#include "procs/mosaic/known_images.h"

#include <opencv2/imgcodecs.hpp>
#include <stdexcept>
#include <utility>

#include "libs/mosaic/brightness.h"

namespace mapmend {

KnownImages::KnownImages(TileFile* file, FetchImage fetch) : file_(file), fetch_(std::move(fetch)) {
  for (const auto& [key, note] : file_->Images()) {
    const cv::Mat brightness = cv::imdecode(note.brightness, cv::IMREAD_COLOR);
    if (brightness.empty()) continue;
    ids_[key] = note.id;
    images_[note.id] = {key, note.width, note.height, brightness};
  }
}

int KnownImages::Find(const TileFile::ImageKey& key) const {
  const auto it = ids_.find(key);
  return it == ids_.end() ? -1 : it->second;
}

std::optional<cv::Mat> KnownImages::Decode(const TileFile::ImageKey& key) const {
  const std::optional<KeyframeImage> image = fetch_(key.first, KeyframeId(key.second));
  if (!image) return std::nullopt;
  cv::Mat pixels = cv::imdecode(image->bytes, cv::IMREAD_COLOR | cv::IMREAD_IGNORE_ORIENTATION);
  if (pixels.empty()) return std::nullopt;
  return pixels;
}

cv::Mat KnownImages::Fetch(int id) const {
  const TileFile::ImageKey& key = images_.at(id).key;
  std::optional<cv::Mat> pixels = Decode(key);
  if (!pixels) throw std::runtime_error("the image of keyframe " + std::to_string(key.second) + " is gone");
  return std::move(*pixels);
}

std::map<int, cv::Mat> KnownImages::Read(const Snapshot& snapshot, int most) {
  std::multimap<int64_t, TileFile::ImageKey, std::greater<>> wanted;  // newest first
  for (const SnapshotComponent& component : snapshot.components) {
    for (const SnapshotKeyframe& keyframe : component.keyframes) {
      const TileFile::ImageKey key(snapshot.submaps[keyframe.submap].key.session, keyframe.id.value);
      if (!ids_.contains(key) && !absent_.contains(key)) wanted.emplace(keyframe.utime, key);
    }
  }
  std::map<int, cv::Mat> read;
  for (const auto& [utime, key] : wanted) {
    if (static_cast<int>(read.size()) >= most) break;
    std::optional<cv::Mat> pixels = Decode(key);
    if (!pixels) {
      absent_.insert(key);
      continue;
    }
    TileFile::ImageNote note;
    note.width = pixels->cols;
    note.height = pixels->rows;
    const cv::Mat brightness = BrightnessImage(*pixels);
    cv::imencode(".png", brightness, note.brightness);
    const int id = file_->AddImage(key, note);
    ids_[key] = id;
    images_[id] = {key, note.width, note.height, brightness};
    read.emplace(id, std::move(*pixels));
  }
  return read;
}

}  // namespace mapmend
