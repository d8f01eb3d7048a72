#pragma once

#include <cstdint>
#include <functional>
#include <string>
#include <string_view>
#include <vector>

namespace mapmend {

// The wire format of LCM's TCP service as its client speaks it (docs/protocol.md, "The hub").
std::vector<uint8_t> GreetingFrame();
std::vector<uint8_t> PublishFrame(const std::string& channel, const uint8_t* data, size_t size);
std::vector<uint8_t> SubscribeFrame(const std::string& channel);    // a plain name, which matches itself only
std::vector<uint8_t> UnsubscribeFrame(const std::string& channel);  // the same

constexpr size_t kMaxMessageBytes = 64 << 20;  // a hub disconnects those who send more

// Takes the hub's bytes apart.
class FrameParser {
 public:
  using OnMessage = std::function<void(std::string_view channel, const uint8_t* data, size_t size)>;
  // Room for up to `size` more bytes; Received says how many were put there, and calls back for each whole message.
  uint8_t* Room(size_t size);
  // False if the bytes are not the protocol's.
  bool Received(size_t size, const OnMessage& on_message);
  bool greeted() const { return greeted_; }

 private:
  std::vector<uint8_t> input_;
  size_t filled_ = 0, parsed_ = 0;
  bool greeted_ = false;
};

}  // namespace mapmend
