#pragma once

#include <memory>
#include <string>

namespace mapmend {

// Serves the live page over HTTP: / is the page, /state.json what it polls, /report and /files/ the exports in a
// directory. Has a thread of its own.
class LiveServer {
 public:
  // Listens on bind:port at once. files: the directory of the exports, empty for none. Throws std::runtime_error with
  // one line if the port cannot be had.
  LiveServer(const std::string& bind, int port, const std::string& files);
  ~LiveServer();
  LiveServer(const LiveServer&) = delete;
  LiveServer& operator=(const LiveServer&) = delete;

  // What /state.json answers from now on. Thread-safe.
  void SetState(std::string json);
  // Whether somebody looks at the page: true for some seconds after each request. Without a reader the state need not
  // be made.
  bool WantsState() const;
  std::string Url() const;

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

}  // namespace mapmend
