#pragma once

#include <cstdint>
#include <vector>

#include "libs/bus/bus.h"
#include "libs/stream/keyframe_images.h"

// The images of keyframes and what is said about them, to and from their wire form. Decode refuses sizes that do not
// fit, unknown encodings, and images of more than kMaxImageBytes.
namespace mapmend {

// MAPMEND_KEYFRAME_IMAGE
template <>
std::vector<uint8_t> Encode(const ImagePiece& piece);
template <>
Decoded<ImagePiece> Decode(const uint8_t* data, int size);

// MAPMEND_IMAGE_REQUEST
template <>
std::vector<uint8_t> Encode(const ImageRequest& request);
template <>
Decoded<ImageRequest> Decode(const uint8_t* data, int size);

// MAPMEND_IMAGE_FETCH, MAPMEND_IMAGE_FETCHED
template <>
std::vector<uint8_t> Encode(const ImageFetch& request);
template <>
Decoded<ImageFetch> Decode(const uint8_t* data, int size);
template <>
std::vector<uint8_t> Encode(const ImageAnswer& answer);
template <>
Decoded<ImageAnswer> Decode(const uint8_t* data, int size);

// MAPMEND_IMAGE_STATUS_REQUEST, MAPMEND_IMAGE_STATUS
template <>
std::vector<uint8_t> Encode(const ImageStatusRequest& request);
template <>
Decoded<ImageStatusRequest> Decode(const uint8_t* data, int size);
template <>
std::vector<uint8_t> Encode(const ImageStatus& status);
template <>
Decoded<ImageStatus> Decode(const uint8_t* data, int size);

}  // namespace mapmend
