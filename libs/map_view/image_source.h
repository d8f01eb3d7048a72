#pragma once

#include <functional>
#include <optional>
#include <string>

#include "libs/stream/keyframe_images.h"
#include "libs/stream/records.h"

namespace mapmend {

// The image of a keyframe, if there is one. May be empty: there are no images.
using FetchImage = std::function<std::optional<KeyframeImage>(const std::string& session, KeyframeId keyframe)>;
// A keyframe's record with all that the map model has dropped, by its number in the stream.
using FetchKeyframe = std::function<std::optional<KeyframeRecord>(const std::string& session, int64_t seq)>;

// What the store has for pictures.
struct PictureSource {
  FetchImage image;
  FetchKeyframe keyframe;
};

}  // namespace mapmend
