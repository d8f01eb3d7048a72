#pragma once

#include <opencv2/core.hpp>

#include "libs/stream/keyframe_images.h"

namespace mapmend {

// The image of a keyframe as it was taken, whatever its header says of up: 8 bits, 3 channels (BGR). Empty if it cannot
// be decoded.
//   side  so many pixels along the longer side are enough; a JPEG that has more is decoded to a half, a quarter or an
//         eighth of its size, which is faster. 0: all that there are
cv::Mat DecodePixels(const KeyframeImage& image, int side = 0);

}  // namespace mapmend
