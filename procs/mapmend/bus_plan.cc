#include "procs/mapmend/bus_plan.h"

#include <netdb.h>
#include <poll.h>
#include <sys/socket.h>
#include <unistd.h>

#include <CLI/CLI.hpp>
#include <cerrno>
#include <charconv>
#include <cstdlib>
#include <cstring>
#include <memory>
#include <stdexcept>

namespace mapmend {
namespace {

enum class Listener { kNobody, kHub, kOther };

// Connects and waits for the greeting of LCM's TCP service: 0x287617fa, big-endian, then its version
// (lcm/TCPService.java).
Listener Probe(const std::string& host, int port) {
  addrinfo hints{};
  hints.ai_family = AF_UNSPEC;
  hints.ai_socktype = SOCK_STREAM;
  addrinfo* found = nullptr;
  if (const int error = getaddrinfo(host.c_str(), std::to_string(port).c_str(), &hints, &found); error != 0) {
    throw std::runtime_error("--lcm-url: host " + host + ": " + gai_strerror(error));
  }
  const std::unique_ptr<addrinfo, void (*)(addrinfo*)> addresses(found, freeaddrinfo);
  const int fd = socket(found->ai_family, SOCK_STREAM | SOCK_CLOEXEC | SOCK_NONBLOCK, 0);
  if (fd < 0) return Listener::kNobody;
  Listener result = Listener::kNobody;
  int error = connect(fd, found->ai_addr, found->ai_addrlen) == 0 ? 0 : errno;
  pollfd wait{fd, POLLOUT, 0};
  if (error == EINPROGRESS && poll(&wait, 1, 2000) == 1) {
    socklen_t size = sizeof(error);
    getsockopt(fd, SOL_SOCKET, SO_ERROR, &error, &size);
  }
  if (error == 0) {
    result = Listener::kOther;
    unsigned char greeting[4] = {0, 0, 0, 0};
    size_t size = 0;
    wait.events = POLLIN;
    while (size < sizeof(greeting) && poll(&wait, 1, 2000) == 1) {
      const ssize_t count = read(fd, greeting + size, sizeof(greeting) - size);
      if (count <= 0) break;
      size += static_cast<size_t>(count);
    }
    const unsigned char kMagic[4] = {0x28, 0x76, 0x17, 0xfa};
    if (size == sizeof(greeting) && std::memcmp(greeting, kMagic, sizeof(kMagic)) == 0) result = Listener::kHub;
  }
  close(fd);
  return result;
}

bool IsThisHost(const std::string& host) { return host == "localhost" || host.starts_with("127."); }

}  // namespace

std::string UrlFromOptionOrEnvironment(const std::string& option) {
  if (!option.empty()) return option;
  const char* url = std::getenv("LCM_DEFAULT_URL");
  return url == nullptr ? "" : url;
}

void AddBusOptions(CLI::App* sub, std::string* lcm_url, std::string* channel_prefix, std::string* log_level) {
  sub->add_option(
      "--lcm-url", *lcm_url,
      "LCM network, e.g. tcpq://127.0.0.1:7700; a hub is started there unless one runs (default: $LCM_DEFAULT_URL, "
      "else a private hub on a free port)");
  sub->add_option("--channel-prefix", *channel_prefix, "put before every channel name, so that runs can share a bus");
  sub->add_option("--log-level", *log_level, "of the log files in OUT/logs: debug, info, warn or error")
      ->check(CLI::IsMember({"debug", "info", "warn", "error"}))
      ->capture_default_str();
}

BusPlan PlanBus(const std::string& url) {
  BusPlan plan;
  plan.url = url;
  plan.hub_bind = "127.0.0.1";
  if (url.empty()) {
    plan.start_hub = true;
    return plan;
  }
  if (url.starts_with("udpm://")) return plan;
  const std::string scheme = "tcpq://";
  const std::string address = url.starts_with(scheme) ? url.substr(scheme.size()) : "";
  const size_t colon = address.rfind(':');
  int port = 0;
  if (colon != std::string::npos) {
    const char* const end = address.data() + address.size();
    const auto parsed = std::from_chars(address.data() + colon + 1, end, port);
    if (parsed.ptr != end || port < 1 || port > 65535) port = 0;
  }
  const std::string host = address.substr(0, colon);
  if (port == 0 || host.empty()) {
    throw std::runtime_error("--lcm-url " + url + ": expected tcpq://HOST:PORT or udpm://ADDRESS:PORT?ttl=N");
  }
  switch (Probe(host, port)) {
    case Listener::kHub:
      return plan;
    case Listener::kOther:
      throw std::runtime_error("--lcm-url " + url + ": port " + std::to_string(port) +
                               " is in use by a program that is not an LCM hub; choose another port");
    case Listener::kNobody:
      break;
  }
  if (!IsThisHost(host))
    throw std::runtime_error("--lcm-url " + url + ": no hub answers there; start `mapmend hub` on that host");
  plan.start_hub = true;
  plan.hub_port = port;
  if (host != "localhost") plan.hub_bind = host;
  return plan;
}

}  // namespace mapmend
