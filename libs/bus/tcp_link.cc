#include "libs/bus/tcp_link.h"

#include <poll.h>
#include <spdlog/spdlog.h>
#include <sys/eventfd.h>
#include <sys/socket.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <csignal>
#include <cstring>

#include "libs/bus/access_token.h"
#include "libs/bus/hub.h"

namespace mapmend {
namespace {

using std::chrono::milliseconds;

constexpr int kMaxWaitMs = 250;
constexpr milliseconds kAsleep(1000);  // a longer pause between two rounds: this process was stopped or starved
constexpr size_t kNumLatest = 2;       // messages kept of a channel that wants the newest only

std::string NewPingChannel() {
  std::random_device random;
  char name[40];
  std::snprintf(name, sizeof(name), "MAPMEND_PING_%08x%08x", random(), random());
  return name;
}

}  // namespace

TcpLink::TcpLink(const TcpLinkOptions& options)
    : options_(options), ping_channel_(NewPingChannel()), outgoing_(options.outgoing), random_(std::random_device{}()) {
  wake_fd_ = eventfd(0, EFD_NONBLOCK | EFD_CLOEXEC);
  if (wake_fd_ < 0) throw std::runtime_error(std::string("cannot make an event descriptor: ") + std::strerror(errno));
  // Signals are for the process's own threads.
  sigset_t all, before;
  sigfillset(&all);
  pthread_sigmask(SIG_SETMASK, &all, &before);
  thread_ = std::thread([this] { Run(); });
  pthread_sigmask(SIG_SETMASK, &before, nullptr);
  std::unique_lock lock(mutex_);
  changed_.wait_for(lock, milliseconds(options_.first_connect_wait_ms), [this] { return tried_once_; });
}

TcpLink::~TcpLink() {
  {
    const std::lock_guard lock(mutex_);
    stop_ = true;
    Wake();
  }
  thread_.join();
  close(wake_fd_);
}

void TcpLink::Wake() {
  if (wake_is_due_) return;
  wake_is_due_ = true;
  const uint64_t one = 1;
  if (write(wake_fd_, &one, sizeof(one)) < 0) wake_is_due_ = false;
}

void TcpLink::Add(std::shared_ptr<Subscriber> subscriber) {
  const std::lock_guard lock(mutex_);
  const std::string name = subscriber->channel();
  Channel& channel = channels_[name];
  channel.keeps_all = channel.keeps_all || subscriber->delivery() == Delivery::kKeepAll;
  channel.subscribers.push_back(std::move(subscriber));
  if (!is_up_ || channel.subscribers.size() > 1) return;
  outgoing_.Push(SubscribeFrame(name), OutgoingFrames::Kind::kControl);
  Wake();
}

void TcpLink::Remove(const Subscriber* subscriber) {
  const std::lock_guard lock(mutex_);
  const auto it = channels_.find(subscriber->channel());
  if (it == channels_.end()) return;
  std::erase_if(it->second.subscribers, [&](const auto& s) { return s.get() == subscriber; });
  if (!it->second.subscribers.empty()) return;
  channels_.erase(it);
  if (!is_up_) return;
  outgoing_.Push(UnsubscribeFrame(subscriber->channel()), OutgoingFrames::Kind::kControl);
  Wake();
}

bool TcpLink::Publish(const std::string& channel, const uint8_t* data, int size) {
  if (!is_up_) return false;
  if (size < 0 || static_cast<size_t>(size) > kMaxMessageBytes) {
    spdlog::error("{}: a message of {} bytes is too large for the hub", channel, size);
    return false;
  }
  std::vector<uint8_t> frame = PublishFrame(channel, data, static_cast<size_t>(size));
  const auto kind = IsBestEffortChannel(channel) ? OutgoingFrames::Kind::kBestEffort : OutgoingFrames::Kind::kReliable;
  const std::lock_guard lock(mutex_);
  if (!is_up_ || !outgoing_.Push(std::move(frame), kind)) return false;
  Wake();
  return true;
}

int TcpLink::Handle(int timeout_ms) {
  const auto deadline = Clock::now() + milliseconds(timeout_ms);
  for (int num_handled = 0;; ++num_handled) {
    if (num_handled == kMaxMessagesPerHandle) return num_handled;
    Message message;
    std::vector<std::shared_ptr<Subscriber>> subscribers;
    {
      std::unique_lock lock(mutex_);
      if (num_handled == 0) changed_.wait_until(lock, deadline, [this] { return !incoming_.empty(); });
      if (incoming_.empty()) return num_handled;
      message = std::move(incoming_.front());
      incoming_.pop_front();
      const bool was_full = incoming_bytes_ > options_.incoming_bytes;
      incoming_bytes_ -= static_cast<int64_t>(message.data.size());
      if (was_full && incoming_bytes_ <= options_.incoming_bytes) Wake();
      const auto it = channels_.find(message.channel);
      if (it != channels_.end()) subscribers = it->second.subscribers;
    }
    for (const auto& subscriber : subscribers)
      subscriber->Call(message.data.data(), static_cast<int>(message.data.size()));
  }
}

void TcpLink::Deliver(std::string_view name, const uint8_t* data, size_t size) {
  if (name == ping_channel_) {
    connection_->liveness()->OnPong(Clock::now());
    return;
  }
  const std::lock_guard lock(mutex_);
  const auto it = channels_.find(name);
  if (it == channels_.end()) return;
  if (!it->second.keeps_all) {
    const auto is_same = [&](const Message& message) { return message.channel == name; };
    if (std::count_if(incoming_.begin(), incoming_.end(), is_same) >= static_cast<std::ptrdiff_t>(kNumLatest)) {
      const auto oldest = std::find_if(incoming_.begin(), incoming_.end(), is_same);
      incoming_bytes_ -= static_cast<int64_t>(oldest->data.size());
      incoming_.erase(oldest);
    }
  }
  incoming_.push_back({std::string(name), std::vector<uint8_t>(data, data + size)});
  incoming_bytes_ += static_cast<int64_t>(size);
  changed_.notify_all();
}

void TcpLink::Run() {
  last_round_ = Clock::now();
  for (;;) {
    {
      const std::lock_guard lock(mutex_);
      if (stop_) break;
    }
    if (!connection_ && Clock::now() >= next_attempt_) Connect();
    Poll();
  }
  if (connection_ && is_up_) Linger();
}

void TcpLink::Connect() {
  if (!lookup_) lookup_ = std::make_unique<HostLookup>(options_.host, options_.port);
  if (!lookup_->IsDone()) {
    next_attempt_ = Clock::now() + milliseconds(20);
    return;
  }
  std::string error;
  const std::vector<sockaddr_in> addresses = lookup_->Addresses(&error);
  lookup_.reset();  // names may come to mean another host
  if (addresses.empty()) {
    OnDown(error);
    return;
  }
  connection_ = std::make_unique<TcpConnection>(addresses[static_cast<size_t>(num_attempts_++) % addresses.size()],
                                                options_.connection);
  if (!connection_->error().empty()) OnDown(connection_->error());
}

int TcpLink::WaitMs() {
  const auto now = Clock::now();
  if (connection_) return kMaxWaitMs;
  return static_cast<int>(
      std::clamp<int64_t>(std::chrono::ceil<milliseconds>(next_attempt_ - now).count(), 0, kMaxWaitMs));
}

void TcpLink::Poll() {
  pollfd descriptors[2] = {{wake_fd_, POLLIN, 0}, {-1, 0, 0}};
  if (connection_) {
    const std::lock_guard lock(mutex_);
    is_reading_ = incoming_bytes_ <= options_.incoming_bytes;
    descriptors[1].fd = connection_->fd();
    descriptors[1].events = static_cast<short>((is_reading_ ? POLLIN : 0) |
                                               (connection_->IsConnecting() || !outgoing_.Empty() ? POLLOUT : 0));
  }
  poll(descriptors, 2, WaitMs());
  if (descriptors[0].revents != 0) {
    const std::lock_guard lock(mutex_);
    uint64_t count = 0;
    if (read(wake_fd_, &count, sizeof(count)) > 0) wake_is_due_ = false;
  }
  if (connection_) Serve(descriptors[1].revents);
}

void TcpLink::Serve(short events) {
  const auto now = Clock::now();
  // What may have come meanwhile is looked at first.
  if (!is_reading_ || now - last_round_ > kAsleep) connection_->liveness()->OnSign(now);
  last_round_ = now;
  bool alive = true;
  if (events & (POLLOUT | POLLERR | POLLHUP)) alive = connection_->OnWritable();
  if (alive && (events & (POLLIN | POLLERR | POLLHUP)) && !connection_->IsConnecting()) {
    alive = connection_->OnReadable(
        [this](std::string_view channel, const uint8_t* data, size_t size) { Deliver(channel, data, size); });
  }
  if (alive && connection_->IsGreeted()) {
    if (!is_up_) OnUp();
    Ping();
    const std::lock_guard lock(mutex_);
    if (!outgoing_.Write(connection_->fd())) {
      connection_->Fail(std::strerror(errno));
      alive = false;
    }
  }
  if (!alive || !connection_->IsAlive(Clock::now())) OnDown(connection_->error());
}

void TcpLink::Ping() {
  const auto now = Clock::now();
  if (!connection_->liveness()->PingIsDue(now)) return;
  connection_->liveness()->OnPingSent(now);
  const uint8_t nothing = 0;
  const std::lock_guard lock(mutex_);
  outgoing_.Push(PublishFrame(ping_channel_, &nothing, 1), OutgoingFrames::Kind::kControl);
}

void TcpLink::OnUp() {
  if (!last_error_.empty()) spdlog::info("connected to tcpq://{}:{}", options_.host, options_.port);
  last_error_.clear();
  num_failed_ = 0;
  const std::lock_guard lock(mutex_);
  outgoing_.Clear();
  if (!options_.token.empty()) {
    const auto* token = reinterpret_cast<const uint8_t*>(options_.token.data());
    outgoing_.Push(PublishFrame(kTokenChannel, token, options_.token.size()), OutgoingFrames::Kind::kControl);
  }
  outgoing_.Push(SubscribeFrame(ping_channel_), OutgoingFrames::Kind::kControl);
  for (const auto& [name, channel] : channels_) outgoing_.Push(SubscribeFrame(name), OutgoingFrames::Kind::kControl);
  ++num_connections_;
  is_up_ = tried_once_ = true;
  changed_.notify_all();
}

void TcpLink::OnDown(const std::string& error) {
  // Told once, not at each attempt.
  if (is_up_ || last_error_.empty())
    spdlog::warn("no connection to tcpq://{}:{} ({}); trying again", options_.host, options_.port, error);
  last_error_ = error.empty() ? "unknown" : error;
  connection_.reset();
  const int retry_ms = std::min(options_.max_retry_ms, options_.first_retry_ms << std::min(num_failed_++, 10));
  next_attempt_ =
      Clock::now() + milliseconds(std::uniform_int_distribution<int>(retry_ms / 2, 3 * retry_ms / 2)(random_));
  const std::lock_guard lock(mutex_);
  is_up_ = false;
  outgoing_.Clear();  // on another connection a half message would be no message
  tried_once_ = true;
  changed_.notify_all();
}

void TcpLink::Linger() {
  const auto deadline = Clock::now() + milliseconds(options_.linger_ms);
  bool has_ended = false;  // everything is sent
  while (Clock::now() < deadline) {
    const std::lock_guard lock(mutex_);
    if (!outgoing_.Write(connection_->fd())) return;
    if (outgoing_.Empty() && !has_ended) {
      shutdown(connection_->fd(), SHUT_WR);
      has_ended = true;
    }
    const auto remaining = std::chrono::ceil<milliseconds>(deadline - Clock::now()).count();
    pollfd descriptor = {connection_->fd(), static_cast<short>(POLLIN | (has_ended ? 0 : POLLOUT)), 0};
    poll(&descriptor, 1, static_cast<int>(std::max<int64_t>(0, remaining)));
    // To the end: closing while something is unread would take back what is on its way.
    if (descriptor.revents != 0 && !connection_->OnReadable([](std::string_view, const uint8_t*, size_t) {})) return;
  }
}

}  // namespace mapmend
