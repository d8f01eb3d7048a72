#include "libs/stream/feature_source.h"

#include <stdexcept>
#include <string>

namespace mapmend {

std::shared_ptr<const Features> FeatureReader::Read(int submap, const SubmapKeyframe& keyframe) {
  std::shared_ptr<const Features> features;
  if (open_) {
    if (!source_) source_ = open_();
    features = std::make_shared<const Features>(source_->Read(submap, keyframe));
  } else {
    features = std::shared_ptr<const Features>(std::shared_ptr<void>(), &keyframe.features);  // the submap's own
  }
  const size_t n = keyframe.map_points.size();
  if (features->keypoints.size() != n || features->descriptors.size() != n) {
    throw std::runtime_error("keyframe " + std::to_string(keyframe.id.value) + " has " +
                             std::to_string(features->keypoints.size()) + " keypoints and " +
                             std::to_string(features->descriptors.size()) + " descriptors for " + std::to_string(n) +
                             " features");
  }
  return features;
}

}  // namespace mapmend
