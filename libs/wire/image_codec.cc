#include "libs/wire/image_codec.h"

#include <mapmend/image_fetch_t.hpp>
#include <mapmend/image_fetched_t.hpp>
#include <mapmend/image_request_t.hpp>
#include <mapmend/image_status_request_t.hpp>
#include <mapmend/image_status_t.hpp>
#include <mapmend/keyframe_image_t.hpp>

#include "libs/wire/addressed.h"

namespace mapmend {
namespace {

using wire::AboutSession;
using wire::AddressedAs;
using wire::Addressing;
using wire::Count;
using wire::ReadStatus;
using wire::Require;

static_assert(static_cast<int>(ImageAnswer::Status::kNone) == image_fetched_t::NONE);

constexpr int kMaxSide = 1 << 16;  // pixels

keyframe_image_t ToMessage(const ImagePiece& piece) {
  const KeyframeImage& image = piece.image;
  keyframe_image_t message{};
  message.session = image.session;
  message.keyframe = image.keyframe.value;
  message.frame = image.frame;
  message.utime = image.utime;
  message.width = image.width;
  message.height = image.height;
  message.encoding = image.encoding;
  message.size = piece.size;
  message.crc32 = static_cast<int32_t>(piece.crc32);
  message.offset = piece.offset;
  message.data = image.bytes;
  message.num_bytes = Count(message.data);
  return message;
}

ImagePiece Read(const keyframe_image_t& m) {
  ImagePiece piece;
  KeyframeImage& image = piece.image;
  image.session = m.session;
  image.keyframe = KeyframeId(m.keyframe);
  image.frame = m.frame;
  image.utime = m.utime;
  image.width = m.width;
  image.height = m.height;
  image.encoding = m.encoding;
  piece.size = m.size;
  piece.crc32 = static_cast<uint32_t>(m.crc32);
  piece.offset = m.offset;
  if (m.encoding.empty()) {
    Require(m.size == 0 && m.num_bytes == 0 && m.offset == 0, "bytes without an encoding");
    return piece;
  }
  Require(IsImageEncoding(m.encoding), "encoding is unknown");
  Require(m.size > 0 && m.size <= kMaxImageBytes, "size of the image is out of range");
  Require(m.offset >= 0 && m.offset < m.size && m.num_bytes > 0 && m.num_bytes <= m.size - m.offset,
          "piece lies outside the image");
  Require(m.width > 0 && m.width < kMaxSide && m.height > 0 && m.height < kMaxSide, "pixels are out of range");
  image.bytes = m.data;
  return piece;
}

image_request_t ToMessage(const ImageRequest& request) {
  image_request_t message{};
  message.session = request.session;
  for (const WantedImage& wanted : request.wanted) {
    message.wanted.push_back(wanted.keyframe.value);
    message.frame.push_back(wanted.frame);
    message.offset.push_back(wanted.offset);
  }
  message.num_wanted = Count(message.wanted);
  for (const KeyframeId stored : request.stored) message.stored.push_back(stored.value);
  message.num_stored = Count(message.stored);
  return message;
}

ImageRequest Read(const image_request_t& m) {
  ImageRequest request;
  request.session = m.session;
  for (size_t i = 0; i < m.wanted.size(); ++i) {
    Require(m.offset[i] >= 0, "offset is negative");
    request.wanted.push_back({KeyframeId(m.wanted[i]), m.frame[i], m.offset[i]});
  }
  for (const int32_t stored : m.stored) request.stored.emplace_back(stored);
  return request;
}

image_fetch_t ToMessage(const ImageFetch& request) {
  auto message = AboutSession<image_fetch_t>(request);
  message.keyframe = request.keyframe.value;
  return message;
}

ImageFetch Read(const image_fetch_t& m) { return {{m.id, m.requester}, m.session, KeyframeId(m.keyframe)}; }

image_fetched_t ToMessage(const ImageAnswer& answer) {
  auto message = Addressing<image_fetched_t>(answer);
  message.status = static_cast<int8_t>(answer.status);
  message.image = ToMessage(ImagePiece{answer.image, static_cast<int>(answer.image.bytes.size()), 0, 0});
  return message;
}

ImageAnswer Read(const image_fetched_t& m) {
  auto answer = AddressedAs<ImageAnswer>(m);
  answer.status = ReadStatus(m.status, ImageAnswer::Status::kNone);
  answer.image = Read(m.image).image;
  Require(m.image.num_bytes == m.image.size, "image is not whole");
  Require((answer.status == ImageAnswer::Status::kOk) != answer.image.bytes.empty(), "status does not fit the image");
  return answer;
}

image_status_request_t ToMessage(const ImageStatusRequest& request) {
  return AboutSession<image_status_request_t>(request);
}

ImageStatusRequest Read(const image_status_request_t& m) { return {{m.id, m.requester}, m.session}; }

image_status_t ToMessage(const ImageStatus& status) {
  auto message = AboutSession<image_status_t>(status);
  message.num_stored = status.num_stored;
  message.num_awaited = status.num_awaited;
  message.num_lost = status.num_lost;
  for (const ImageStatus::Awaited& awaited : status.awaited) {
    message.keyframe.push_back(awaited.keyframe.value);
    message.frame.push_back(awaited.frame);
  }
  message.num_listed = Count(message.keyframe);
  return message;
}

ImageStatus Read(const image_status_t& m) {
  Require(m.num_stored >= 0 && m.num_awaited >= 0 && m.num_lost >= 0, "a count is negative");
  ImageStatus status;
  status.id = m.id;
  status.requester = m.requester;
  status.session = m.session;
  status.num_stored = m.num_stored;
  status.num_awaited = m.num_awaited;
  status.num_lost = m.num_lost;
  for (size_t i = 0; i < m.keyframe.size(); ++i) status.awaited.push_back({KeyframeId(m.keyframe[i]), m.frame[i]});
  return status;
}

}  // namespace

template <>
std::vector<uint8_t> Encode(const ImagePiece& piece) {
  return EncodeMessage(ToMessage(piece));
}

template <>
Decoded<ImagePiece> Decode(const uint8_t* data, int size) {
  return wire::DecodeChecked<ImagePiece, keyframe_image_t>(data, size, Read);
}

template <>
std::vector<uint8_t> Encode(const ImageRequest& request) {
  return EncodeMessage(ToMessage(request));
}

template <>
Decoded<ImageRequest> Decode(const uint8_t* data, int size) {
  return wire::DecodeChecked<ImageRequest, image_request_t>(data, size, Read);
}

template <>
std::vector<uint8_t> Encode(const ImageFetch& request) {
  return EncodeMessage(ToMessage(request));
}

template <>
Decoded<ImageFetch> Decode(const uint8_t* data, int size) {
  return wire::DecodeChecked<ImageFetch, image_fetch_t>(data, size, Read);
}

template <>
std::vector<uint8_t> Encode(const ImageAnswer& answer) {
  return EncodeMessage(ToMessage(answer));
}

template <>
Decoded<ImageAnswer> Decode(const uint8_t* data, int size) {
  return wire::DecodeChecked<ImageAnswer, image_fetched_t>(data, size, Read);
}

template <>
std::vector<uint8_t> Encode(const ImageStatusRequest& request) {
  return EncodeMessage(ToMessage(request));
}

template <>
Decoded<ImageStatusRequest> Decode(const uint8_t* data, int size) {
  return wire::DecodeChecked<ImageStatusRequest, image_status_request_t>(data, size, Read);
}

template <>
std::vector<uint8_t> Encode(const ImageStatus& status) {
  return EncodeMessage(ToMessage(status));
}

template <>
Decoded<ImageStatus> Decode(const uint8_t* data, int size) {
  return wire::DecodeChecked<ImageStatus, image_status_t>(data, size, Read);
}

}  // namespace mapmend
