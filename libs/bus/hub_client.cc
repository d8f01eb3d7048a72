#include "libs/bus/hub_client.h"

#include <netinet/in.h>
#include <netinet/tcp.h>
#include <sys/socket.h>
#include <sys/uio.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <cstring>

#include "libs/bus/hub.h"

namespace mapmend {
namespace {

constexpr uint32_t kMagicServer = 0x287617fa;
constexpr uint32_t kMagicClient = 0x287617fb;
constexpr uint32_t kProtocolVersion = 0x0100;
constexpr uint32_t kPublish = 1, kSubscribe = 2, kUnsubscribe = 3;
constexpr uint32_t kMaxChannelLength = 1024;  // of a pattern; channel names are shorter
constexpr size_t kReadChunk = 256 << 10;
constexpr size_t kMaxPatterns = 4096;
constexpr size_t kMaxCachedChannels = 4096;

uint32_t ReadU32(const uint8_t* p) {
  return static_cast<uint32_t>(p[0]) << 24 | static_cast<uint32_t>(p[1]) << 16 | static_cast<uint32_t>(p[2]) << 8 |
         p[3];
}

void AppendU32(uint32_t value, std::vector<uint8_t>* bytes) {
  for (int shift = 24; shift >= 0; shift -= 8) bytes->push_back(static_cast<uint8_t>(value >> shift));
}

}  // namespace

HubClient::HubClient(int fd, int64_t max_message_bytes)
    : last_write(std::chrono::steady_clock::now()), fd_(fd), max_message_bytes_(max_message_bytes) {
  const int one = 1;
  setsockopt(fd_, IPPROTO_TCP, TCP_NODELAY, &one, sizeof(one));
  setsockopt(fd_, SOL_SOCKET, SO_KEEPALIVE, &one, sizeof(one));
  auto greeting = std::make_shared<HubFrame>();
  AppendU32(kMagicServer, &greeting->bytes);
  AppendU32(kProtocolVersion, &greeting->bytes);
  Enqueue(std::move(greeting));
}

HubClient::~HubClient() { close(fd_); }

bool HubClient::Refuse() {
  misbehaved_ = true;
  return false;
}

bool HubClient::Read(const std::function<void(std::string_view, std::shared_ptr<const HubFrame>)>& publish) {
  const size_t filled = input_.size();
  input_.resize(filled + kReadChunk);
  const ssize_t n = recv(fd_, input_.data() + filled, kReadChunk, 0);
  input_.resize(filled + static_cast<size_t>(std::max<ssize_t>(n, 0)));
  if (n == 0) return false;
  if (n < 0) return errno == EAGAIN || errno == EWOULDBLOCK || errno == EINTR;
  // liblcm sends a message in up to five small pieces; without this each waits for a delayed acknowledgement.
  const int one = 1;
  setsockopt(fd_, IPPROTO_TCP, TCP_QUICKACK, &one, sizeof(one));
  return Parse(publish);
}

bool HubClient::Parse(const std::function<void(std::string_view, std::shared_ptr<const HubFrame>)>& publish) {
  for (;;) {
    const uint8_t* p = input_.data() + parsed_;
    const size_t available = input_.size() - parsed_;
    size_t used = 0;
    if (!greeted_) {
      if (available < 8) break;
      if (ReadU32(p) != kMagicClient || ReadU32(p + 4) >> 8 != kProtocolVersion >> 8) return Refuse();
      greeted_ = true;
      used = 8;
    } else {
      if (available < 8) break;
      const uint32_t type = ReadU32(p);
      const uint32_t channel_length = ReadU32(p + 4);
      if (type < kPublish || type > kUnsubscribe || channel_length > kMaxChannelLength) return Refuse();
      if (available < 8 + static_cast<size_t>(channel_length)) break;
      const std::string_view channel(reinterpret_cast<const char*>(p + 8), channel_length);
      used = 8 + channel_length;
      if (type == kPublish) {
        if (available < used + 4) break;
        const uint32_t size = ReadU32(p + used);
        if (static_cast<int64_t>(size) > max_message_bytes_) return Refuse();
        used += 4 + static_cast<size_t>(size);
        if (available < used) {
          input_.reserve(parsed_ + used + kReadChunk);
          break;
        }
        auto frame = std::make_shared<HubFrame>();
        frame->bytes.assign(p, p + used);  // what is sent on is what came
        frame->best_effort = IsBestEffortChannel(std::string(channel));
        publish(channel, std::move(frame));
      } else if (type == kSubscribe) {
        if (patterns_.size() >= kMaxPatterns) return Refuse();
        Pattern pattern;
        pattern.text = channel;
        pattern.is_plain = pattern.text.find_first_of("\\^$.|?*+()[]{}") == std::string::npos;
        try {
          if (!pattern.is_plain) pattern.regex.assign(pattern.text, std::regex::optimize);
        } catch (const std::regex_error&) {
          return Refuse();
        }
        patterns_.push_back(std::move(pattern));
        wants_.clear();
      } else {
        const auto it =
            std::find_if(patterns_.begin(), patterns_.end(), [&](const Pattern& x) { return x.text == channel; });
        if (it != patterns_.end()) patterns_.erase(it);
        wants_.clear();
      }
    }
    parsed_ += used;
  }
  if (parsed_ == input_.size()) {
    input_.clear();
    parsed_ = 0;
  } else if (parsed_ > kReadChunk) {
    input_.erase(input_.begin(), input_.begin() + static_cast<std::ptrdiff_t>(parsed_));
    parsed_ = 0;
  }
  return true;
}

bool HubClient::Write() {
  while (!queue_.empty()) {
    iovec pieces[64];
    int num_pieces = 0;
    size_t skip = sent_of_front_;
    for (auto it = queue_.begin(); it != queue_.end() && num_pieces < 64; ++it, ++num_pieces) {
      const auto& bytes = (*it)->bytes;
      pieces[num_pieces] = {const_cast<uint8_t*>(bytes.data()) + skip, bytes.size() - skip};
      skip = 0;
    }
    msghdr message{};
    message.msg_iov = pieces;
    message.msg_iovlen = static_cast<size_t>(num_pieces);
    const ssize_t n = sendmsg(fd_, &message, MSG_NOSIGNAL | MSG_DONTWAIT);
    if (n < 0) return errno == EAGAIN || errno == EWOULDBLOCK || errno == EINTR;
    last_write = std::chrono::steady_clock::now();
    size_t done = sent_of_front_ + static_cast<size_t>(n);
    while (!queue_.empty() && done >= queue_.front()->bytes.size()) {
      const auto size = static_cast<int64_t>(queue_.front()->bytes.size());
      (queue_.front()->best_effort ? best_effort_bytes_ : reliable_bytes_) -= size;
      done -= static_cast<size_t>(size);
      queue_.pop_front();
    }
    sent_of_front_ = done;
  }
  return true;
}

bool HubClient::Wants(const std::string& channel) {
  const auto it = wants_.find(channel);
  if (it != wants_.end()) return it->second;
  const bool wants = std::any_of(patterns_.begin(), patterns_.end(), [&](const Pattern& pattern) {
    return pattern.is_plain ? pattern.text == channel : std::regex_match(channel, pattern.regex);
  });
  if (wants_.size() >= kMaxCachedChannels) wants_.clear();
  wants_[channel] = wants;
  return wants;
}

void HubClient::Enqueue(std::shared_ptr<const HubFrame> frame) {
  if (queue_.empty()) last_write = std::chrono::steady_clock::now();
  (frame->best_effort ? best_effort_bytes_ : reliable_bytes_) += static_cast<int64_t>(frame->bytes.size());
  queue_.push_back(std::move(frame));
}

int HubClient::DropOldestBestEffort(int64_t limit) {
  if (best_effort_bytes_ <= limit) return 0;
  int num_dropped = 0;
  std::deque<std::shared_ptr<const HubFrame>> kept;
  for (size_t i = 0; i < queue_.size(); ++i) {
    const bool is_started = i == 0 && sent_of_front_ > 0;
    if (queue_[i]->best_effort && best_effort_bytes_ > limit && !is_started) {
      best_effort_bytes_ -= static_cast<int64_t>(queue_[i]->bytes.size());
      ++num_dropped;
    } else {
      kept.push_back(std::move(queue_[i]));
    }
  }
  queue_.swap(kept);
  return num_dropped;
}

}  // namespace mapmend
