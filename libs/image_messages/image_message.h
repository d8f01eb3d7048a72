#pragma once

#include <cstdint>
#include <string>

#include "libs/capture/decode_image.h"

// Images on MAPMEND_IMAGE are untrusted: from any camera process, over a network.
namespace mapmend {

class image_t;

// Turns an image_t of mapmend, or of bot_core (foreign_image.h), into mapmend's. False if the bytes are neither.
bool DecodeImageMessage(const uint8_t* data, int size, image_t* message);

// The camera says that no more images come: an image_t with all fields 0. One alone proves nothing (ends_of_stream.h).
bool IsEndOfStream(const image_t& message);

// Why an image is refused, one line; empty if it may be decoded. A JPEG's own header must agree, so that decoding never
// allocates more than the camera's size.
//   width, height  of the camera
std::string ImageProblem(const image_t& message, int width, int height);

// 8-bit grey or BGR; without pixels if the JPEG is damaged. Call only without ImageProblem.
DecodedImage DecodeImage(const image_t& message);

}  // namespace mapmend
