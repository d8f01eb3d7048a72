#pragma once

#include <chrono>
#include <cstdint>
#include <memory>
#include <string>

#include "procs/viewer_export/live_feed.h"

namespace mapmend {

struct StreamLimits {
  int max_streams = 32;          // one more, and the oldest of the host that has most makes room
  int max_streams_per_host = 8;  // likewise; of another host
  size_t message_bytes = 256 << 10;
  std::chrono::milliseconds interval{200};         // between two messages to a page that is up to date
  std::chrono::milliseconds keep_alive{15000};     // a page that hears nothing for so long gets a sign of life
  std::chrono::milliseconds stall_timeout{20000};  // a page that takes nothing for so long is dropped
};

// Server-sent events (WHATWG HTML, section 9.2): what changes in a feed, to any number of pages, by one thread. A page
// gets the next message only once it has taken the last one, so what waits for a slow page is bounded, and it loses
// nothing. The id of an event is EPOCH:VERSION of the feed.
class EventStreams {
 public:
  // The feed must outlive it.
  explicit EventStreams(const LiveFeed* feed, const StreamLimits& limits = {});
  ~EventStreams();
  EventStreams(const EventStreams&) = delete;
  EventStreams& operator=(const EventStreams&) = delete;

  // Takes over a connection on which the head of the answer has been sent. address: of the other side. last_event_id:
  // what the page has seen; empty or of another epoch: nothing.
  void Add(int fd, const std::string& address, const std::string& last_event_id);
  int NumStreams() const;
  // The feed has changed.
  void Wake();
  // Waits until every page has taken all that is in the feed, at most so long.
  void Flush(std::chrono::milliseconds timeout);

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

}  // namespace mapmend
