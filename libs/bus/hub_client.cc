#include "libs/bus/hub_client.h"

#include <arpa/inet.h>
#include <linux/tcp.h>
#include <netinet/in.h>
#include <sys/socket.h>
#include <sys/uio.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <cstring>

#include "libs/bus/congestion.h"

namespace mapmend {
namespace {

constexpr uint32_t kMagicServer = 0x287617fa;
constexpr uint32_t kMagicClient = 0x287617fb;
constexpr uint32_t kProtocolVersion = 0x0100;
constexpr uint32_t kPublish = 1, kSubscribe = 2, kUnsubscribe = 3;
constexpr uint32_t kMaxPatternLength = 1024;
constexpr uint32_t kMaxChannelLength = 255;  // LCM allows 63
constexpr size_t kReadChunk = 256 << 10;
constexpr size_t kKeptCapacity = 16 << 10;  // of an input buffer that is empty
constexpr auto kTurn = std::chrono::milliseconds(5);

uint32_t ReadU32(const uint8_t* p) {
  return static_cast<uint32_t>(p[0]) << 24 | static_cast<uint32_t>(p[1]) << 16 | static_cast<uint32_t>(p[2]) << 8 |
         p[3];
}

void AppendU32(uint32_t value, std::vector<uint8_t>* bytes) {
  for (int shift = 24; shift >= 0; shift -= 8) bytes->push_back(static_cast<uint8_t>(value >> shift));
}

void SetOption(int fd, int level, int option, int value) { setsockopt(fd, level, option, &value, sizeof(value)); }

// A host that was switched off, or whose link was cut, is found within 4 s while nothing is to be sent to it.
void ConfigureSocket(int fd) {
  SetOption(fd, IPPROTO_TCP, TCP_NODELAY, 1);
  SetOption(fd, SOL_SOCKET, SO_KEEPALIVE, 1);
  SetOption(fd, IPPROTO_TCP, TCP_KEEPIDLE, 1);
  SetOption(fd, IPPROTO_TCP, TCP_KEEPINTVL, 1);
  SetOption(fd, IPPROTO_TCP, TCP_KEEPCNT, 3);
  // On a link that loses packets a few lost repetitions must not make the next one wait for ever longer.
  SetOption(fd, IPPROTO_TCP, TCP_THIN_LINEAR_TIMEOUTS, 1);
  sockaddr_in peer{};
  socklen_t size = sizeof(peer);
  if (getpeername(fd, reinterpret_cast<sockaddr*>(&peer), &size) == 0) PreferBbr(fd, peer);
}

}  // namespace

HubFrame::HubFrame(std::vector<uint8_t> bytes, bool best_effort, HubMemory* memory)
    : bytes_(std::move(bytes)), best_effort_(best_effort), memory_(memory) {
  memory_->bytes += cost();
}

HubFrame::~HubFrame() { memory_->bytes -= cost(); }

HubClient::HubClient(int fd, uint32_t address, int64_t max_message_bytes, HubMemory* memory)
    : accepted(Clock::now()),
      last_read(accepted),
      last_write(accepted),
      fd_(fd),
      address_(address),
      max_message_bytes_(max_message_bytes),
      memory_(memory) {
  ConfigureSocket(fd_);
  std::vector<uint8_t> greeting;
  AppendU32(kMagicServer, &greeting);
  AppendU32(kProtocolVersion, &greeting);
  Enqueue(std::make_shared<HubFrame>(std::move(greeting), false, memory_));
}

HubClient::~HubClient() {
  memory_->bytes -= static_cast<int64_t>(input_.capacity());
  close(fd_);
}

int64_t HubClient::held_bytes() const {
  return static_cast<int64_t>(input_.capacity()) + reliable_bytes_ + best_effort_bytes_;
}

size_t HubClient::Refuse(const std::string& fault) {
  fault_ = fault;
  return 0;
}

bool HubClient::Read(const HubHandlers& handlers) {
  // One for all clients: most of what comes is handled at once and never kept.
  static thread_local std::vector<uint8_t> chunk(kReadChunk);
  const int64_t capacity_before = static_cast<int64_t>(input_.capacity());
  if (has_backlog_) {
    const size_t done = Parse(input_.data(), input_.size(), handlers);
    input_.erase(input_.begin(), input_.begin() + static_cast<std::ptrdiff_t>(done));
  } else {
    const ssize_t n = recv(fd_, chunk.data(), chunk.size(), MSG_DONTWAIT);
    if (n == 0) return false;
    if (n < 0) return errno == EAGAIN || errno == EWOULDBLOCK || errno == EINTR;
    // liblcm sends a message in up to five small pieces; without this each waits for a delayed acknowledgement.
    SetOption(fd_, IPPROTO_TCP, TCP_QUICKACK, 1);
    last_read = Clock::now();
    const auto size = static_cast<size_t>(n);
    if (input_.empty()) {
      const size_t done = Parse(chunk.data(), size, handlers);
      KeepRest(chunk.data() + done, size - done);
    } else {
      KeepRest(chunk.data(), size);
      const size_t done = Parse(input_.data(), input_.size(), handlers);
      input_.erase(input_.begin(), input_.begin() + static_cast<std::ptrdiff_t>(done));
    }
  }
  if (input_.empty() && input_.capacity() > kKeptCapacity) std::vector<uint8_t>().swap(input_);
  memory_->bytes += static_cast<int64_t>(input_.capacity()) - capacity_before;
  return fault_.empty();
}

// A message that is announced as large takes what has come of it, not what was announced.
void HubClient::KeepRest(const uint8_t* data, size_t size) {
  if (size == 0) return;
  const size_t needed = input_.size() + size;
  if (needed > input_.capacity())
    input_.reserve(std::max(needed, std::min(2 * input_.capacity(), expected_ + kReadChunk)));
  input_.insert(input_.end(), data, data + size);
}

size_t HubClient::Parse(const uint8_t* data, size_t size, const HubHandlers& handlers) {
  const auto end_of_turn = Clock::now() + kTurn;
  size_t done = 0;
  expected_ = 0;
  for (has_backlog_ = false;; has_backlog_ = paused || Clock::now() >= end_of_turn) {
    if (has_backlog_) return done;
    const uint8_t* p = data + done;
    const size_t available = size - done;
    if (available < 8) return done;
    if (!greeted_) {
      if (ReadU32(p) != kMagicClient || ReadU32(p + 4) >> 8 != kProtocolVersion >> 8)
        return Refuse("it does not speak LCM's TCP protocol");
      greeted_ = true;
      done += 8;
      continue;
    }
    const uint32_t type = ReadU32(p);
    const uint32_t length = ReadU32(p + 4);
    if (type < kPublish || type > kUnsubscribe) return Refuse("it does not speak LCM's TCP protocol");
    if (length > (type == kPublish ? kMaxChannelLength : kMaxPatternLength))
      return Refuse("a channel's name of " + std::to_string(length) + " bytes");
    size_t used = 8 + static_cast<size_t>(length);
    if (available < used) return done;
    const std::string_view channel(reinterpret_cast<const char*>(p + 8), length);
    if (type == kPublish) {
      if (available < used + 4) return done;
      const uint32_t data_size = ReadU32(p + used);
      if (static_cast<int64_t>(data_size) > max_message_bytes_)
        return Refuse("a message of " + std::to_string(data_size) + " bytes");
      const uint8_t* const message = p + used + 4;
      used += 4 + static_cast<size_t>(data_size);
      if (available < used) {
        expected_ = used;
        return done;
      }
      if (!handlers.publish(this, channel, {reinterpret_cast<const char*>(message), data_size},
                            {reinterpret_cast<const char*>(p), used})) {
        return 0;
      }
    } else if (type == kSubscribe) {
      const std::string problem = handlers.subscribe(this, channel);
      if (!problem.empty()) return Refuse("subscription '" + std::string(channel.substr(0, 60)) + "': " + problem);
    } else {
      handlers.unsubscribe(this, channel);
    }
    done += used;
  }
}

bool HubClient::Write() {
  while (!queue_.empty()) {
    iovec pieces[64];
    int num_pieces = 0;
    size_t skip = sent_of_front_;
    for (auto it = queue_.begin(); it != queue_.end() && num_pieces < 64; ++it, ++num_pieces) {
      const auto& bytes = (*it)->bytes();
      pieces[num_pieces] = {const_cast<uint8_t*>(bytes.data()) + skip, bytes.size() - skip};
      skip = 0;
    }
    msghdr message{};
    message.msg_iov = pieces;
    message.msg_iovlen = static_cast<size_t>(num_pieces);
    const ssize_t n = sendmsg(fd_, &message, MSG_NOSIGNAL | MSG_DONTWAIT);
    if (n < 0) return errno == EAGAIN || errno == EWOULDBLOCK || errno == EINTR;
    last_write = Clock::now();
    size_t done = sent_of_front_ + static_cast<size_t>(n);
    while (!queue_.empty() && done >= queue_.front()->bytes().size()) {
      const HubFrame& front = *queue_.front();
      (front.best_effort() ? best_effort_bytes_ : reliable_bytes_) -= front.cost();
      done -= front.bytes().size();
      queue_.pop_front();
    }
    sent_of_front_ = done;
  }
  return true;
}

void HubClient::Enqueue(std::shared_ptr<const HubFrame> frame) {
  if (queue_.empty()) last_write = Clock::now();
  (frame->best_effort() ? best_effort_bytes_ : reliable_bytes_) += frame->cost();
  queue_.push_back(std::move(frame));
}

int HubClient::DropOldestBestEffort(int64_t limit) {
  if (best_effort_bytes_ <= limit) return 0;
  // Some more than have to go, so that the queue is not gone through for every message.
  const int64_t wanted = limit - limit / 8;
  int num_dropped = 0;
  std::deque<std::shared_ptr<const HubFrame>> kept;
  for (size_t i = 0; i < queue_.size(); ++i) {
    const bool is_started = i == 0 && sent_of_front_ > 0;
    if (queue_[i]->best_effort() && best_effort_bytes_ > wanted && !is_started) {
      best_effort_bytes_ -= queue_[i]->cost();
      ++num_dropped;
    } else {
      kept.push_back(std::move(queue_[i]));
    }
  }
  queue_.swap(kept);
  return num_dropped;
}

bool HubClient::IsSilent(std::chrono::milliseconds timeout) const {
  tcp_info info{};
  socklen_t size = sizeof(info);
  if (getsockopt(fd_, IPPROTO_TCP, TCP_INFO, &info, &size) != 0) return false;
  // One that does not read closes its window: then the kernel asks at ever longer intervals whether it is open again,
  // and silence says nothing.
  const bool has_closed_window = info.tcpi_snd_wnd < info.tcpi_snd_mss;
  return info.tcpi_unacked > 0 && !has_closed_window &&
         info.tcpi_last_ack_recv > static_cast<uint32_t>(timeout.count());
}

std::string AddressText(uint32_t address) {
  const in_addr value{htonl(address)};
  char text[INET_ADDRSTRLEN] = "";
  inet_ntop(AF_INET, &value, text, sizeof(text));
  return text;
}

}  // namespace mapmend
