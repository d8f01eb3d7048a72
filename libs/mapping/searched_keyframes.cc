#include "libs/mapping/searched_keyframes.h"

#include <stdexcept>
#include <string>

namespace mapmend {

std::shared_ptr<const SearchedKeyframe> SearchedKeyframes::Get(int index) {
  const auto known = position_.find(index);
  if (known != position_.end()) {
    entries_.splice(entries_.begin(), entries_, known->second);
    return known->second->searched;
  }
  const int submap = map_.keyframes[index].submap;
  const SubmapKeyframe& keyframe = *map_.keyframes[index].keyframe;
  const Pinhole& camera = map_.CameraOf(index);
  auto searched = std::make_shared<SearchedKeyframe>();
  searched->grid = FeatureGrid(keyframe.features.keypoints, camera.width, camera.height);
  if (open_) {
    if (!source_) source_ = open_();
    searched->read = source_->Read(submap, keyframe);
    searched->descriptors = &searched->read;
  } else {
    searched->descriptors = &keyframe.features.descriptors;
  }
  if (searched->descriptors->size() != keyframe.features.keypoints.size()) {
    throw std::runtime_error("keyframe " + std::to_string(keyframe.id.value) + " has " +
                             std::to_string(searched->descriptors->size()) + " descriptors for " +
                             std::to_string(keyframe.features.keypoints.size()) + " features");
  }
  entries_.push_front({index, searched});
  position_[index] = entries_.begin();
  if (static_cast<int>(entries_.size()) > capacity_) {
    position_.erase(entries_.back().keyframe);
    entries_.pop_back();
  }
  return searched;
}

}  // namespace mapmend
