#include "libs/bus/hub.h"

#include <arpa/inet.h>
#include <malloc.h>
#include <spdlog/spdlog.h>
#include <sys/epoll.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <chrono>
#include <cstring>
#include <map>
#include <stdexcept>
#include <string_view>
#include <vector>

#include "libs/base/options.h"
#include "libs/bus/access_token.h"
#include "libs/bus/channels.h"
#include "libs/bus/hub_client.h"
#include "libs/bus/hub_door.h"

namespace mapmend {
namespace {

using Clock = HubClient::Clock;
using std::chrono::milliseconds;

constexpr int kOtherDescriptors = 32;  // that a process needs besides its clients
constexpr int kMaxNotGreeted = 64, kMaxNotGreetedPerAddress = 16;
constexpr size_t kMaxExpressionsOfAll = 256;  // over all clients
constexpr size_t kMaxRoutes = 1024;
constexpr int kMaxWrongTokens = 3;
constexpr milliseconds kHousekeepingInterval(500), kDeadAfter(4000), kPartTimeout(30000), kImpatience(60000),
    kDeafAfter(120000);
constexpr int64_t kTrimAbove = 16 << 20;
constexpr char kPingChannel[] = "MAPMEND_PING";

// Lines about misbehaviour, few enough that nobody can fill a disk with them.
class RareWarnings {
 public:
  void Say(const std::string& text) {
    const auto now = Clock::now();
    if (now >= next_window_) {
      if (num_said_ > kMax) spdlog::warn("hub: {} more warnings were left out", num_said_ - kMax);
      next_window_ = now + std::chrono::minutes(1);
      num_said_ = 0;
    }
    if (++num_said_ <= kMax) spdlog::warn("hub: {}", text);
  }

 private:
  static constexpr int kMax = 20;  // a minute
  Clock::time_point next_window_;
  int num_said_ = 0;
};

// What a stranger sent, fit for a line of a log.
std::string Printable(std::string_view text) {
  std::string result(text.substr(0, 200));
  std::replace_if(
      result.begin(), result.end(), [](char c) { return c < 32 || c > 126; }, '?');
  return result;
}

bool IsLoopback(const in_addr& address) { return ntohl(address.s_addr) >> 24 == 127; }

}  // namespace

bool IsBestEffortChannel(const std::string& channel) {
  for (const char* name :
       {channels::kFramePose, channels::kImage, channels::kHealth, channels::kAck, channels::kStreamState}) {
    if (channel.ends_with(name)) return true;
  }
  return false;
}

std::string HubOptions::Check() const { return CheckOptions(*this); }

std::string HubOptions::Conflict() const {
  in_addr address{};
  if (inet_pton(AF_INET, bind.c_str(), &address) != 1) return "bind address '" + bind + "' is not an IPv4 address";
  if (!IsLoopback(address) && token.empty())
    return "bind address " + bind +
           " admits other hosts, which needs a token: give --token-file FILE (it is made if "
           "it does not exist)";
  return "";
}

struct Hub::Impl {
  explicit Impl(const HubOptions& hub_options) : options(hub_options), door(options.bind, options.port) {
    handlers.publish = [this](HubClient* client, std::string_view channel, std::string_view data,
                              std::string_view wire) { return OnPublish(client, channel, data, wire); };
    handlers.subscribe = [this](HubClient* client, std::string_view pattern) {
      routes.clear();
      client->has_acted = true;
      // Strangers cannot use up all expressions.
      return client->subscriptions.Add(pattern, client->trusted ? kMaxExpressionsOfAll : kMaxExpressionsOfAll / 2,
                                       &expressions);
    };
    handlers.unsubscribe = [this](HubClient* client, std::string_view pattern) {
      routes.clear();
      client->subscriptions.Remove(pattern);
    };
    options.max_clients = std::min(options.max_clients, std::max(4, RaiseDescriptorLimit() - kOtherDescriptors));
  }
  ~Impl() {
    clients.clear();
    if (epoll >= 0) close(epoll);
  }

  HubOptions options;
  HubDoor door;
  int epoll = -1;
  HubMemory memory;  // outlives the clients
  HubExpressions expressions;
  std::map<int, std::unique_ptr<HubClient>> clients;  // by descriptor
  HubHandlers handlers;
  std::map<std::string, std::vector<HubClient*>, std::less<>> routes;  // who wants a channel, as far as known
  Statistics statistics;
  RareWarnings warnings;
  bool any_paused = false, any_backlog = false;
  int64_t peak_bytes = 0;  // since memory was last given back
  Clock::time_point next_housekeeping;

  void Watch(HubClient* client);
  void Admit();
  bool MakeRoom(uint32_t address);
  HubClient* OldestNotGreeted(uint32_t address, bool any_address, int* count);
  void Remove(HubClient* client);
  bool OnPublish(HubClient* publisher, std::string_view channel, std::string_view data, std::string_view wire);
  bool OnToken(HubClient* client, std::string_view token);
  const std::vector<HubClient*>& Subscribers(std::string_view channel);
  void Deliver(HubClient* publisher, HubClient* subscriber, const std::shared_ptr<const HubFrame>& frame);
  void MarkStalled();
  void Resume();
  void Shed();
  void KeepHouse();
};

void Hub::Impl::Watch(HubClient* client) {
  const bool reads = !client->paused && !client->has_backlog();
  const uint32_t events = (reads ? uint32_t{EPOLLIN} : 0u) | (client->has_output() ? uint32_t{EPOLLOUT} : 0u);
  if (events == client->events) return;
  epoll_event event{};
  event.events = events;
  event.data.fd = client->fd();
  epoll_ctl(epoll, EPOLL_CTL_MOD, client->fd(), &event);
  client->events = events;
}

HubClient* Hub::Impl::OldestNotGreeted(uint32_t address, bool any_address, int* count) {
  HubClient* oldest = nullptr;
  *count = 0;
  for (auto& [fd, client] : clients) {
    if (client->greeted() || (!any_address && client->address() != address)) continue;
    ++*count;
    if (oldest == nullptr || client->accepted < oldest->accepted) oldest = client.get();
  }
  return oldest;
}

// Whoever has not greeted yet has to make room for newcomers, the longest there first: a real client greets at once. If
// all places are taken, so have those who greeted and then neither subscribed nor published.
bool Hub::Impl::MakeRoom(uint32_t address) {
  const bool is_local = address >> 24 == 127;
  const auto drop = [this](HubClient* client) {
    ++statistics.num_turned_away;
    Remove(client);
  };
  int count = 0;
  HubClient* oldest = OldestNotGreeted(address, /*any_address=*/false, &count);
  if (!is_local && count >= kMaxNotGreetedPerAddress) drop(oldest);
  oldest = OldestNotGreeted(address, /*any_address=*/true, &count);
  const int limit = std::min(kMaxNotGreeted, options.max_clients / 4);
  if (count >= limit) drop(oldest);
  const int total = static_cast<int>(clients.size());
  if (is_local ? total < options.max_clients : total < options.max_clients - options.max_clients / 4) return true;
  // The longest here that has not done anything yet, greeted or not.
  oldest = nullptr;
  for (auto& [fd, client] : clients) {
    if (!client->has_acted && (oldest == nullptr || client->accepted < oldest->accepted)) oldest = client.get();
  }
  if (oldest == nullptr) return false;
  drop(oldest);
  return true;
}

void Hub::Impl::Admit() {
  for (const HubDoor::Guest& guest : door.Open(&statistics.num_turned_away)) {
    auto client = std::make_unique<HubClient>(guest.fd, guest.address, options.max_message_bytes, &memory);
    client->trusted = client->is_local();
    if (!MakeRoom(guest.address)) {
      ++statistics.num_turned_away;
      warnings.Say("a client from " + AddressText(guest.address) + " was turned away: there are " +
                   std::to_string(clients.size()) + " clients");
      continue;
    }
    epoll_event event{};
    event.events = EPOLLIN | EPOLLOUT;
    event.data.fd = guest.fd;
    client->events = event.events;
    if (epoll_ctl(epoll, EPOLL_CTL_ADD, guest.fd, &event) == 0) clients[guest.fd] = std::move(client);
  }
}

void Hub::Impl::Remove(HubClient* client) {
  if (!client->fault().empty()) {
    ++statistics.num_refused_clients;
    warnings.Say("disconnected a client from " + AddressText(client->address()) + ": " + Printable(client->fault()));
  }
  routes.clear();
  clients.erase(client->fd());  // closing the descriptor takes it out of epoll
}

bool Hub::Impl::OnToken(HubClient* client, std::string_view token) {
  if (client->is_local()) return true;
  if (!options.token.empty() && TokensAreEqual(token, options.token)) {
    client->trusted = true;
    return true;
  }
  client->trusted = false;
  warnings.Say("a client from " + AddressText(client->address()) + " has shown a wrong token");
  if (++client->num_wrong_tokens < kMaxWrongTokens) return true;
  client->SetFault("it has shown " + std::to_string(kMaxWrongTokens) + " wrong tokens");
  return false;
}

const std::vector<HubClient*>& Hub::Impl::Subscribers(std::string_view channel) {
  const auto it = routes.find(channel);
  if (it != routes.end()) return it->second;
  if (routes.size() >= kMaxRoutes) routes.clear();
  const std::string name(channel);
  std::vector<HubClient*>& subscribers = routes[name];
  for (auto& [fd, client] : clients) {
    if (client->subscriptions.Match(name)) subscribers.push_back(client.get());
  }
  return subscribers;
}

// Gives the message to everybody who wants it. The publisher is paused if one of them has too much waiting.
bool Hub::Impl::OnPublish(HubClient* publisher, std::string_view channel, std::string_view data,
                          std::string_view wire) {
  if (channel.ends_with(kTokenChannel)) return OnToken(publisher, data);
  ++statistics.num_messages;
  publisher->has_acted = true;
  // A ping is how a client learns that its connection lives: without token it is sent back, and to nobody else.
  const bool to_itself_only = !publisher->trusted && channel.find(kPingChannel) != std::string_view::npos;
  if (!publisher->trusted && !to_itself_only) {
    ++statistics.num_dropped_unauthorised;
    if (!publisher->told_of_no_token) {
      publisher->told_of_no_token = true;
      warnings.Say("a client from " + AddressText(publisher->address()) + " publishes on " +
                   Printable(channel.substr(0, 63)) +
                   " without token: its messages are dropped (start it with --token-file)");
    }
    return true;
  }
  const std::vector<HubClient*>& subscribers = Subscribers(channel);
  if (subscribers.empty()) return true;
  const auto* const bytes = reinterpret_cast<const uint8_t*>(wire.data());
  const auto frame = std::make_shared<const HubFrame>(std::vector<uint8_t>(bytes, bytes + wire.size()),
                                                      IsBestEffortChannel(std::string(channel)), &memory);
  for (HubClient* subscriber : subscribers) {
    if (!to_itself_only || subscriber == publisher) Deliver(publisher, subscriber, frame);
  }
  return true;
}

void Hub::Impl::Deliver(HubClient* publisher, HubClient* subscriber, const std::shared_ptr<const HubFrame>& frame) {
  if (!frame->best_effort() && subscriber->stalled) {
    ++statistics.num_dropped_reliable;
    return;
  }
  subscriber->Enqueue(frame);
  if (frame->best_effort()) {
    statistics.num_dropped += subscriber->DropOldestBestEffort(options.best_effort_queue_bytes);
    return;
  }
  if (subscriber->reliable_bytes() <= options.reliable_queue_bytes) return;
  // Sockets may just have room that epoll has not told of yet.
  subscriber->Write();
  if (subscriber->reliable_bytes() <= options.reliable_queue_bytes) return;
  if (!subscriber->trusted || Clock::now() < subscriber->no_patience_until)
    subscriber->stalled = true;
  else
    publisher->paused = any_paused = true;
}

void Hub::Impl::MarkStalled() {
  const auto now = Clock::now();
  for (auto& [fd, client] : clients) {
    if (client->reliable_bytes() <= options.reliable_queue_bytes || client->stalled) continue;
    if (now - client->last_write < milliseconds(options.backpressure_timeout_ms)) continue;
    client->stalled = true;
    client->no_patience_until = now + kImpatience;
    warnings.Say("a subscriber from " + AddressText(client->address()) + " has not read for " +
                 std::to_string(options.backpressure_timeout_ms) + " ms with " +
                 std::to_string(client->reliable_bytes() >> 20) + " MB waiting; it misses messages from now on");
  }
}

// Lets publishers go on once no subscriber that counts is full.
void Hub::Impl::Resume() {
  bool full = false;
  for (auto& [fd, client] : clients)
    full = full || (!client->stalled && client->reliable_bytes() > options.reliable_queue_bytes);
  if (full) return;
  for (auto& [fd, client] : clients) client->paused = false;
  any_paused = false;
}

// Gives up clients until what is held is within its bound again.
void Hub::Impl::Shed() {
  if (memory.bytes <= options.max_buffered_bytes) return;
  for (auto& [fd, client] : clients) statistics.num_dropped += client->DropOldestBestEffort(0);
  while (memory.bytes > options.max_buffered_bytes && !clients.empty()) {
    const auto most = std::max_element(clients.begin(), clients.end(), [](const auto& a, const auto& b) {
      return a.second->held_bytes() < b.second->held_bytes();
    });
    HubClient* const client = most->second.get();
    client->SetFault("with " + std::to_string(client->held_bytes() >> 20) + " MB it has most of the " +
                     std::to_string(options.max_buffered_bytes >> 20) + " MB that may be held for all");
    Remove(client);
  }
}

void Hub::Impl::KeepHouse() {
  const auto now = Clock::now();
  if (now < next_housekeeping) return;
  next_housekeeping = now + kHousekeepingInterval;
  std::vector<HubClient*> leaving;
  for (auto& [fd, client] : clients) {
    if (!client->greeted() && now - client->accepted >= milliseconds(options.greeting_timeout_ms)) {
      ++statistics.num_turned_away;
      leaving.push_back(client.get());
    } else if (client->has_part() && !client->has_backlog() && !client->paused &&
               now - client->last_read >= kPartTimeout) {
      client->SetFault("it has begun a message and not gone on for " + std::to_string(kPartTimeout.count() / 1000) +
                       " s");
      leaving.push_back(client.get());
    } else if (client->has_output() && now - client->last_write >= kDeafAfter) {
      client->SetFault("it has not read for " + std::to_string(kDeafAfter.count() / 1000) + " s");
      leaving.push_back(client.get());
    } else if (client->IsSilent(kDeadAfter)) {
      ++statistics.num_dead_clients;
      warnings.Say("nothing is heard of the host of a client from " + AddressText(client->address()) +
                   "; disconnected");
      leaving.push_back(client.get());
    }
  }
  for (HubClient* client : leaving) Remove(client);
  // The allocator keeps what was used once; a hub that is idle again should be small again.
  peak_bytes = std::max(peak_bytes, memory.bytes);
  if (peak_bytes > kTrimAbove && memory.bytes < peak_bytes / 4) {
    malloc_trim(0);
    peak_bytes = memory.bytes;
  }
}

Hub::Hub(const HubOptions& options) {
  if (const std::string error = options.Check(); !error.empty()) throw std::runtime_error(error);
  impl_ = std::make_unique<Impl>(options);
  impl_->epoll = epoll_create1(EPOLL_CLOEXEC);
  epoll_event event{};
  event.events = EPOLLIN;
  event.data.fd = impl_->door.fd();
  if (impl_->epoll < 0 || epoll_ctl(impl_->epoll, EPOLL_CTL_ADD, impl_->door.fd(), &event) != 0)
    throw std::runtime_error(std::string("cannot watch the hub's port: ") + std::strerror(errno));
}

Hub::~Hub() = default;

int Hub::Port() const { return impl_->door.port(); }

void Hub::Spin(int timeout_ms) {
  epoll_event events[64];
  if (impl_->any_paused) timeout_ms = std::min(timeout_ms, 50);
  if (impl_->any_backlog) timeout_ms = 0;
  const int n = epoll_wait(impl_->epoll, events, 64, timeout_ms);
  const auto serve = [this](HubClient* client, uint32_t what) {
    bool alive = true;
    if (what & EPOLLOUT) alive = client->Write();
    if (alive && (what & (EPOLLIN | EPOLLHUP | EPOLLERR))) alive = client->Read(impl_->handlers);
    impl_->peak_bytes = std::max(impl_->peak_bytes, impl_->memory.bytes);
    if (!alive) impl_->Remove(client);
    impl_->Shed();
  };
  for (int i = 0; i < n; ++i) {
    const int fd = events[i].data.fd;
    if (fd == impl_->door.fd()) {
      impl_->Admit();
      continue;
    }
    const auto it = impl_->clients.find(fd);
    if (it != impl_->clients.end()) serve(it->second.get(), events[i].events);
  }
  if (impl_->any_backlog) {
    std::vector<int> waiting;
    for (const auto& [fd, client] : impl_->clients) {
      if (client->has_backlog() && !client->paused) waiting.push_back(fd);
    }
    for (const int fd : waiting) {
      const auto it = impl_->clients.find(fd);
      if (it != impl_->clients.end()) serve(it->second.get(), EPOLLIN);
    }
  }
  if (impl_->any_paused) {
    impl_->MarkStalled();
    impl_->Resume();
  }
  impl_->KeepHouse();
  impl_->any_backlog = false;
  for (auto& [fd, client] : impl_->clients) {
    if (client->has_output()) client->Write();  // an error shows as EPOLLHUP
    if (client->stalled && client->reliable_bytes() <= impl_->options.reliable_queue_bytes / 2) client->stalled = false;
    impl_->any_backlog = impl_->any_backlog || (client->has_backlog() && !client->paused);
    impl_->Watch(client.get());
  }
}

Hub::Statistics Hub::GetStatistics() const {
  Statistics statistics = impl_->statistics;
  statistics.num_clients = static_cast<int>(impl_->clients.size());
  for (const auto& [fd, client] : impl_->clients)
    statistics.queued_bytes += client->reliable_bytes() + client->best_effort_bytes();
  statistics.buffered_bytes = impl_->memory.bytes;
  return statistics;
}

}  // namespace mapmend
