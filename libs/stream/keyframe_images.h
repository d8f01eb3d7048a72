#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "libs/stream/ids.h"
#include "libs/stream/store_questions.h"

// The images of keyframes, which travel beside the stream and never in its way (docs/protocol.md, Images of keyframes;
// libs/wire/image_codec.h has the wire form).
namespace mapmend {

// Encoded as it came from a camera or folder, or as the frontend encoded it.
struct KeyframeImage {
  std::string session;
  KeyframeId keyframe;
  int frame = -1;             // index in the input
  int64_t utime = 0;          // of the image
  int width = 0, height = 0;  // pixels
  std::string encoding;       // "jpeg" or "png"
  std::vector<uint8_t> bytes;
  bool operator==(const KeyframeImage&) const = default;
};

// The encodings that there are.
inline bool IsImageEncoding(const std::string& encoding) { return encoding == "jpeg" || encoding == "png"; }
// "jpg" or "png": how files are called.
inline std::string ImageSuffix(const std::string& encoding) { return encoding == "png" ? "png" : "jpg"; }

// No encoded image is larger, bytes.
inline constexpr int kMaxImageBytes = 48 << 20;

// A part of one, on its way to the store. All but `bytes` is that of the whole; without encoding: there is none.
struct ImagePiece {
  KeyframeImage image;  // bytes: those of this piece
  int size = 0;         // of the whole, bytes
  uint32_t crc32 = 0;   // of the whole
  int offset = 0;
  bool operator==(const ImagePiece&) const = default;
};

// Whose image: the frame tells that both sides mean the same keyframe, since one that was never published may have had
// its number.
struct WantedImage {
  KeyframeId keyframe;
  int frame = -1;
  int offset = 0;  // bytes that the store has already
  bool operator==(const WantedImage&) const = default;
};

struct ImageRequest {
  std::string session;
  std::vector<WantedImage> wanted;  // most wanted first
  std::vector<KeyframeId> stored;   // need not be kept any more
  bool operator==(const ImageRequest&) const = default;
};

struct ImageFetch : Addressed {
  std::string session;
  KeyframeId keyframe;
  bool operator==(const ImageFetch&) const = default;
};
struct ImageAnswer : Addressed {
  enum class Status { kOk, kNone };
  Status status = Status::kNone;
  KeyframeImage image;
  bool operator==(const ImageAnswer&) const = default;
};

struct ImageStatusRequest : Addressed {
  std::string session;  // empty: all of them together
  bool operator==(const ImageStatusRequest&) const = default;
};
// How many keyframes, without those that were culled, have their images.
struct ImageStatus : Addressed {
  std::string session;
  int num_stored = 0;
  int num_awaited = 0;  // may still come
  int num_lost = 0;     // their sender does not have them
  struct Awaited {
    KeyframeId keyframe;
    int frame = -1;
    bool operator==(const Awaited&) const = default;
  };
  std::vector<Awaited> awaited;  // of one session
  bool operator==(const ImageStatus&) const = default;
};

}  // namespace mapmend
