#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "libs/map_view/image_source.h"
#include "libs/map_view/snapshot.h"

namespace mapmend {

struct ConnectionPictureOptions {
  int height = 720;              // of each image, pixels
  std::string encoding = "png";  // or "jpeg"
};

// The two keyframes that say most about a connection, side by side, with what was matched in them: green, of an
// accepted connection, what fits it; orange, of a rejected one, what looked alike. Where an image is missing, its
// features alone. Empty if there is nothing to show.
std::vector<uint8_t> DrawConnection(const Snapshot& snapshot, const EvaluatedConnection& connection,
                                    const PictureSource& source, const ConnectionPictureOptions& options = {});

// One keyframe with its features as a JPEG: those that see a map point are rings, green (bright) and thick; the others
// are small and grey. Empty if there is no such keyframe. Without an image its features stand on grey.
//   with_features  false: the image alone
std::vector<uint8_t> DrawKeyframe(const MapModel& model, const SubmapKey& key, KeyframeId id, const FetchImage& image,
                                  int height, bool with_features);

}  // namespace mapmend
