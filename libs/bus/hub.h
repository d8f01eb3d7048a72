#pragma once

#include <cstdint>
#include <memory>
#include <string>

#include "libs/base/range.h"

namespace mapmend {

struct HubOptions {
  std::string bind = "127.0.0.1";  // address to listen on; "0.0.0.0" admits other hosts, and needs a token
  int port = 7700;                 // 0: any free port
  // What a client of another host has to publish on MAPMEND_TOKEN before anything else that it publishes is passed on
  // (docs/protocol.md). It may listen without. Clients of this host need none.
  std::string token;
  int max_clients = 256;                 // the last quarter is kept for this host
  int greeting_timeout_ms = 5000;        // who connects and does not greet is disconnected
  int64_t max_message_bytes = 64 << 20;  // a client that sends more is disconnected
  // All that is held for all clients together. Beyond it the client that has most of it is disconnected.
  int64_t max_buffered_bytes = 256 << 20;
  // Per client: what waits to be sent to it. Best-effort channels drop their oldest beyond the first; on all others a
  // publisher has to wait while some subscriber has more than the second waiting.
  int64_t best_effort_queue_bytes = 8 << 20;
  int64_t reliable_queue_bytes = 16 << 20;
  // A subscriber that does not read for as long while publishers wait for it misses messages until it reads again, and
  // nobody waits for it again within the next minute. For one that needs a token and has not shown it nobody waits.
  int backpressure_timeout_ms = 3000;

  // Not visited: token: a secret.
  template <typename Visitor>
  void Visit(Visitor& v) {
    v("bind", bind);
    v("port", port, Range(0, 65535));
    v("max_clients", max_clients, Range(4, 100000));
    v("greeting_timeout_ms", greeting_timeout_ms, Range(1, 3.6e6), "ms");
    v("max_message_bytes", max_message_bytes, Range(1, 1e12), "bytes");
    v("max_buffered_bytes", max_buffered_bytes, Range(1, 1e12), "bytes");
    v("best_effort_queue_bytes", best_effort_queue_bytes, Range(1, 1e12), "bytes");
    v("reliable_queue_bytes", reliable_queue_bytes, Range(1, 1e12), "bytes");
    v("backpressure_timeout_ms", backpressure_timeout_ms, Range(0, 3.6e6), "ms");
  }
  // Empty, or one line that names the first option that is wrong.
  std::string Check() const;
  // Empty, or what is wrong with the address, of which token is a part.
  std::string Conflict() const;
};

// The exchange of all messages over TCP: a drop-in for LCM's Java TCPService, speaking the protocol of liblcm's tcpq
// provider (docs/protocol.md). One thread, epoll. Every message goes to each client with a matching subscription, in
// the order in which it came. No client can stop the others or use up the host, see HubOptions: what is held is
// bounded, clients are served in turns of a few milliseconds, and those that are dead are dropped within 5 s.
class Hub {
 public:
  // Binds and listens. Throws std::runtime_error with one line, e.g. if the port is in use.
  explicit Hub(const HubOptions& options);
  ~Hub();
  Hub(const Hub&) = delete;
  Hub& operator=(const Hub&) = delete;

  int Port() const;
  // Serves what is due, waiting up to timeout_ms for it. Call in a loop.
  void Spin(int timeout_ms);

  struct Statistics {
    int num_clients = 0;
    int64_t num_messages = 0;              // received from publishers
    int64_t num_dropped = 0;               // best-effort messages that were replaced by newer ones
    int64_t num_dropped_reliable = 0;      // messages that a stalled subscriber missed
    int64_t num_dropped_unauthorised = 0;  // messages from other hosts without token
    int64_t num_refused_clients = 0;       // disconnected because they did not speak the protocol or wanted too much
    int64_t num_turned_away = 0;           // not let in, or let go without having greeted, for want of room or time
    int64_t num_dead_clients = 0;          // disconnected because nothing was heard of their host
    int64_t queued_bytes = 0;              // over all clients, a message counts for each that it waits for
    int64_t buffered_bytes = 0;            // what is held
  };
  Statistics GetStatistics() const;

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

// Channels whose messages may be dropped when a client is slow: live poses, images, health, and those that are repeated
// anyway. A prefix before the name does not matter.
bool IsBestEffortChannel(const std::string& channel);

}  // namespace mapmend
