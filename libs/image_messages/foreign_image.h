#pragma once

#include <cstdint>

namespace mapmend {

class image_t;

// Turns bot_core's image_t (as programs built on libbot publish) into mapmend's: grey, RGB, BGR, RGBA, BGRA, YUYV, UYVY
// and JPEG. False if the bytes are none. An image whose sizes do not fit its bytes, or of another format, becomes one
// that ImageProblem refuses. It has no number of its own: frame is 0.
bool DecodeForeignImage(const uint8_t* data, int size, image_t* image);

}  // namespace mapmend
