#include "procs/mosaic/known_images.h"

#include <opencv2/imgcodecs.hpp>
#include <stdexcept>
#include <utility>

#include "libs/map_view/keyframe_pixels.h"
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

cv::Mat KnownImages::Fetch(int id, int side) const {
  const TileFile::ImageKey& key = images_.at(id).key;
  const std::optional<KeyframeImage> image = fetch_(key.first, KeyframeId(key.second));
  cv::Mat pixels = image ? DecodePixels(*image, side) : cv::Mat();
  if (pixels.empty()) throw std::runtime_error("the image of keyframe " + std::to_string(key.second) + " is gone");
  return pixels;
}

int KnownImages::Read(const Snapshot& snapshot, int most, const std::function<void(int, cv::Mat)>& use) {
  std::multimap<int64_t, TileFile::ImageKey, std::greater<>> wanted;  // newest first
  for (const SnapshotComponent& component : snapshot.components) {
    for (const SnapshotKeyframe& keyframe : component.keyframes) {
      const TileFile::ImageKey key(snapshot.submaps[keyframe.submap].key.session, keyframe.id.value);
      if (!ids_.contains(key) && !absent_.contains(key)) wanted.emplace(keyframe.utime, key);
    }
  }
  int num_read = 0;
  for (const auto& [utime, key] : wanted) {
    if (num_read >= most) break;
    const std::optional<KeyframeImage> image = fetch_(key.first, KeyframeId(key.second));
    const cv::Mat small = image ? DecodePixels(*image, kBrightnessSide) : cv::Mat();
    if (small.empty()) {
      absent_.insert(key);
      continue;
    }
    TileFile::ImageNote note;
    note.width = image->width;
    note.height = image->height;
    const cv::Mat brightness = BrightnessImage(small);
    cv::imencode(".png", brightness, note.brightness);
    const int id = file_->AddImage(key, note);
    ids_[key] = id;
    images_[id] = {key, note.width, note.height, brightness};
    ++num_read;
    if (use) use(id, DecodePixels(*image));
  }
  return num_read;
}

}  // namespace mapmend
