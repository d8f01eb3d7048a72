#pragma once

#include <memory>
#include <string>

namespace mapmend {

class LiveFeed;
class LiveQuestions;

struct LiveServerOptions {
  std::string bind = "127.0.0.1";
  int port = 0;
  std::string files;       // folder of results; empty: none
  std::string token;       // who acts on the map must show it; empty: nobody may
  std::string javascript;  // folder of Debian's JavaScript packages; empty: /usr/share/javascript
};

// Serves the live page over HTTP (docs/live_page.md): the page and what it is made of, /events (what
// changes in the feed), pictures, tiles, /report and /files/, and takes decisions on connections. Has threads of its
// own; feed and questions must outlive it.
class LiveServer {
 public:
  // Listens at once. Throws std::runtime_error with one line if the port cannot be had.
  LiveServer(const LiveServerOptions& options, LiveFeed* feed, LiveQuestions* questions);
  ~LiveServer();
  LiveServer(const LiveServer&) = delete;
  LiveServer& operator=(const LiveServer&) = delete;

  // The feed has changed.
  void Wake();
  // Waits until every page has what is in the feed, but not long.
  void Flush();
  int NumPages() const;
  std::string Url() const;

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

}  // namespace mapmend
