#include "libs/merging/searched_keyframes.h"

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
  searched->features = reader_.Read(submap, keyframe);
  searched->grid = FeatureGrid(searched->features->keypoints, camera.width, camera.height);
  entries_.push_front({index, searched});
  position_[index] = entries_.begin();
  if (static_cast<int>(entries_.size()) > capacity_) {
    position_.erase(entries_.back().keyframe);
    entries_.pop_back();
  }
  return searched;
}

}  // namespace mapmend
