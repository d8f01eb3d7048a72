#pragma once

#include <functional>
#include <memory>
#include <utility>

#include "libs/stream/submap.h"

namespace mapmend {

// Where the features of keyframes come from that are not in memory.
class FeatureSource {
 public:
  virtual ~FeatureSource() = default;
  // Keypoints and descriptors of a keyframe of the submap with this index in the merged map. Throws std::runtime_error
  // if they cannot be had.
  virtual Features Read(int submap, const SubmapKeyframe& keyframe) = 0;
};
// Opens such a source when there is something to read. It is closed again when all has been read: connections that
// nobody looks after would fill up. Null: the submaps hold all features; else those that they hold are never looked at.
using OpenFeatureSource = std::function<std::unique_ptr<FeatureSource>()>;

// Reads features from the one or the other.
class FeatureReader {
 public:
  explicit FeatureReader(OpenFeatureSource open) : open_(std::move(open)) {}

  // Throws std::runtime_error if they cannot be had, or are not those of the keyframe.
  std::shared_ptr<const Features> Read(int submap, const SubmapKeyframe& keyframe);
  // Closes the source, until something is read again.
  void Close() { source_.reset(); }

 private:
  const OpenFeatureSource open_;
  std::unique_ptr<FeatureSource> source_;
};

}  // namespace mapmend
