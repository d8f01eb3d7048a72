#pragma once

#include <atomic>
#include <condition_variable>
#include <deque>
#include <map>
#include <memory>
#include <mutex>
#include <random>
#include <string>
#include <string_view>
#include <thread>
#include <vector>

#include "libs/base/range.h"
#include "libs/bus/host_lookup.h"
#include "libs/bus/outgoing_frames.h"
#include "libs/bus/tcp_connection.h"
#include "libs/bus/transport.h"

namespace mapmend {

struct TcpLinkOptions {
  std::string host = "127.0.0.1";
  int port = 7700;
  std::string token;  // told to the hub right after the greeting; empty: none
  TcpConnection::Options connection;
  OutgoingLimits outgoing;
  int64_t incoming_bytes = 32 << 20;                   // beyond it the hub is not read from until Handle has caught up
  int first_retry_ms = 100, max_retry_ms = 1000;       // between attempts, doubled each time, give or take a half
  int first_connect_wait_ms = 1000, linger_ms = 1000;  // the constructor and the destructor wait so long at most

  // Not visited: token: a secret.
  template <typename Visitor>
  void Visit(Visitor& v) {
    v("host", host);
    v("port", port, Range(1, 65535));
    v("connection", connection);
    v("outgoing", outgoing);
    v("incoming_bytes", incoming_bytes, Range(1, 1e12), "bytes");
    v("first_retry_ms", first_retry_ms, Range(1, 3.6e6), "ms");
    v("max_retry_ms", max_retry_ms, Range(1, 3.6e6), "ms");
    v("first_connect_wait_ms", first_connect_wait_ms, Range(0, 3.6e6), "ms");
    v("linger_ms", linger_ms, Range(0, 3.6e6), "ms");
  }
};

// tcpq://HOST:PORT. A thread of its own reads, writes, pings and connects again; Publish and Handle only ever touch
// queues, so nothing that the hub or the network does can hold up their callers. One connection suffices: its thread
// reads whatever its writing does.
class TcpLink : public Transport {
 public:
  // Waits for the first attempt to connect, a moment at most, so that what is published next is not lost.
  explicit TcpLink(const TcpLinkOptions& options);
  // Sends what waits, unless the hub does not take it in time.
  ~TcpLink() override;

  void Add(std::shared_ptr<Subscriber> subscriber) override;
  void Remove(const Subscriber* subscriber) override;
  bool Publish(const std::string& channel, const uint8_t* data, int size) override;
  int Handle(int timeout_ms) override;
  bool IsConnected() const override { return is_up_; }
  int64_t ConnectionNumber() const override { return num_connections_; }

 private:
  using Clock = std::chrono::steady_clock;
  struct Message {
    std::string channel;
    std::vector<uint8_t> data;
  };
  // A channel keeps all if one of its subscribers wants all.
  struct Channel {
    std::vector<std::shared_ptr<Subscriber>> subscribers;
    bool keeps_all = false;
  };

  // Of the link's thread.
  void Run();
  void Connect();
  void Poll();
  void Serve(short events);
  void OnUp();
  void OnDown(const std::string& error);
  void Linger();
  void Deliver(std::string_view channel, const uint8_t* data, size_t size);
  void Ping();
  int WaitMs();

  void Wake();

  const TcpLinkOptions options_;
  const std::string ping_channel_;

  // Guarded by mutex_.
  std::mutex mutex_;
  std::condition_variable changed_;
  std::map<std::string, Channel, std::less<>> channels_;
  std::deque<Message> incoming_;
  int64_t incoming_bytes_ = 0;
  OutgoingFrames outgoing_;
  bool tried_once_ = false, stop_ = false, wake_is_due_ = false;

  std::atomic<bool> is_up_{false};
  std::atomic<int64_t> num_connections_{0};
  int wake_fd_ = -1;

  // Of the link's thread.
  std::unique_ptr<HostLookup> lookup_;
  std::unique_ptr<TcpConnection> connection_;
  Clock::time_point next_attempt_, last_round_;
  int num_failed_ = 0, num_attempts_ = 0;
  bool is_reading_ = true;
  std::string last_error_;
  std::mt19937 random_;

  std::thread thread_;
};

}  // namespace mapmend
