#pragma once

#include <httplib.h>

#include <atomic>
#include <chrono>
#include <cstdint>
#include <functional>
#include <memory>
#include <string>
#include <vector>

// What keeps strangers from holding up the live page, and from reading what is not meant for it.
namespace mapmend {

// Whether a request may be answered; empty, or what is wrong. A page of another site can have the browser ask here
// under that site's own name (DNS rebinding): so the Host must be an address, localhost, or a name of this host. An
// Origin, if there is one, must be the Host. Ports do not matter (tunnels change them).
std::string CheckHostAndOrigin(const httplib::Request& request, const std::vector<std::string>& own_names);

// The names of this host: as the system says, without its domain, and with .local.
std::vector<std::string> OwnHostNames();

// Opens a regular file below a folder for reading and tells its size. Whatever leads out of the folder, be it dots or
// symbolic links, does not exist, nor do tokens and other files that only their owner may read. Returns -1 if there is
// none, else a descriptor, the caller's.
int OpenBelow(const std::string& folder, const std::string& path, int64_t* size);

struct HttpLimits {
  int max_waiting = 128;  // connections whose request is not complete; the oldest makes room
  int max_waiting_per_host = 32;
  int num_workers = 16;  // answers at once
  size_t max_request_bytes = 16 << 10;
  std::chrono::milliseconds request_timeout{5000};  // for the whole request
  std::chrono::milliseconds answer_timeout{5000};   // for an answer; the longer it is, the more:
  int64_t min_bytes_per_s = 16 << 10;
};

// A server that gives no client a thread before its request is there: one thread waits for all of them, for a bounded
// time. Each connection carries one request without a body. An answer that is taken too slowly is cut off.
class GuardedHttpServer : public httplib::Server {
 public:
  explicit GuardedHttpServer(const HttpLimits& limits = {});
  ~GuardedHttpServer() override;

  // Listens, and then lets more than the library's five wait for being accepted.
  bool Bind(const std::string& address, int port);

  // To be called while a request is answered: an answer with this head and without an end. `take` gets the connection
  // (then its own to close) and the address of the other side once the head has been sent.
  using TakeConnection = std::function<void(int fd, const std::string& address)>;
  static void KeepConnection(const std::string& content_type, TakeConnection take, httplib::Response* response);

 private:
  // The library calls this for each connection that it has accepted. (It is private there; name and meaning are those
  // of Debian's 0.11.)
  bool process_and_close_socket(socket_t socket) override;
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

}  // namespace mapmend
