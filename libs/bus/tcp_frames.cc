#include "libs/bus/tcp_frames.h"

#include <cstring>

namespace mapmend {
namespace {

constexpr uint32_t kMagicServer = 0x287617fa, kMagicClient = 0x287617fb, kProtocolVersion = 0x0100;
constexpr uint32_t kPublish = 1, kSubscribe = 2, kUnsubscribe = 3;
constexpr size_t kMaxChannelLength = 1024;

void PutU32(uint32_t value, std::vector<uint8_t>* bytes) {
  for (int shift = 24; shift >= 0; shift -= 8) bytes->push_back(static_cast<uint8_t>(value >> shift));
}

uint32_t GetU32(const uint8_t* p) {
  return static_cast<uint32_t>(p[0]) << 24 | static_cast<uint32_t>(p[1]) << 16 | static_cast<uint32_t>(p[2]) << 8 |
         p[3];
}

std::vector<uint8_t> TextFrame(uint32_t type, const std::string& text, size_t room_behind) {
  std::vector<uint8_t> frame;
  frame.reserve(8 + text.size() + room_behind);
  PutU32(type, &frame);
  PutU32(static_cast<uint32_t>(text.size()), &frame);
  frame.insert(frame.end(), text.begin(), text.end());
  return frame;
}

}  // namespace

std::vector<uint8_t> GreetingFrame() {
  std::vector<uint8_t> frame;
  PutU32(kMagicClient, &frame);
  PutU32(kProtocolVersion, &frame);
  return frame;
}

std::vector<uint8_t> PublishFrame(const std::string& channel, const uint8_t* data, size_t size) {
  std::vector<uint8_t> frame = TextFrame(kPublish, channel, 4 + size);
  PutU32(static_cast<uint32_t>(size), &frame);
  frame.insert(frame.end(), data, data + size);
  return frame;
}

std::vector<uint8_t> SubscribeFrame(const std::string& channel) { return TextFrame(kSubscribe, channel, 0); }

std::vector<uint8_t> UnsubscribeFrame(const std::string& channel) { return TextFrame(kUnsubscribe, channel, 0); }

uint8_t* FrameParser::Room(size_t size) {
  if (parsed_ > 0 && (parsed_ == filled_ || parsed_ >= size)) {
    std::memmove(input_.data(), input_.data() + parsed_, filled_ - parsed_);
    filled_ -= parsed_;
    parsed_ = 0;
  }
  // What a large message needed is given back once it is gone.
  if (filled_ == 0 && input_.size() > 4 * size) std::vector<uint8_t>().swap(input_);
  if (input_.size() < filled_ + size) input_.resize(filled_ + size);
  return input_.data() + filled_;
}

bool FrameParser::Received(size_t size, const OnMessage& on_message) {
  filled_ += size;
  for (;;) {
    const uint8_t* p = input_.data() + parsed_;
    const size_t available = filled_ - parsed_;
    if (available < 8) return true;
    if (!greeted_) {
      if (GetU32(p) != kMagicServer || GetU32(p + 4) >> 8 != kProtocolVersion >> 8) return false;
      greeted_ = true;
      parsed_ += 8;
      continue;
    }
    const size_t channel_length = GetU32(p + 4);
    if (GetU32(p) != kPublish || channel_length > kMaxChannelLength) return false;
    if (available < 12 + channel_length) return true;
    const size_t data_size = GetU32(p + 8 + channel_length);
    if (data_size > kMaxMessageBytes) return false;
    const size_t used = 12 + channel_length + data_size;
    if (available < used) {
      input_.reserve(parsed_ + used);
      return true;
    }
    on_message({reinterpret_cast<const char*>(p + 8), channel_length}, p + 12 + channel_length, data_size);
    parsed_ += used;
  }
}

}  // namespace mapmend
