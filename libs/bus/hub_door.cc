#include "libs/bus/hub_door.h"

#include <arpa/inet.h>
#include <fcntl.h>
#include <netinet/in.h>
#include <sys/resource.h>
#include <sys/socket.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <cstring>
#include <limits>
#include <stdexcept>

namespace mapmend {
namespace {

constexpr int kBacklog = 512;
constexpr int kMaxGuestsAtOnce = 64;  // so that those who are in are served meanwhile

int OpenReserve() { return open("/dev/null", O_RDONLY | O_CLOEXEC); }

}  // namespace

HubDoor::HubDoor(const std::string& bind, int port) {
  const auto fail = [&](const char* what) {
    const std::string why = std::strerror(errno);
    if (listener_ >= 0) close(listener_);
    throw std::runtime_error(std::string(what) + " " + bind + ":" + std::to_string(port) + ": " + why);
  };
  listener_ = socket(AF_INET, SOCK_STREAM | SOCK_NONBLOCK | SOCK_CLOEXEC, 0);
  if (listener_ < 0) fail("cannot make a socket for");
  const int one = 1;
  setsockopt(listener_, SOL_SOCKET, SO_REUSEADDR, &one, sizeof(one));
  sockaddr_in address{};
  address.sin_family = AF_INET;
  address.sin_port = htons(static_cast<uint16_t>(port));
  inet_pton(AF_INET, bind.c_str(), &address.sin_addr);
  if (::bind(listener_, reinterpret_cast<sockaddr*>(&address), sizeof(address)) != 0 ||
      listen(listener_, kBacklog) != 0) {
    fail("cannot listen on");
  }
  socklen_t length = sizeof(address);
  getsockname(listener_, reinterpret_cast<sockaddr*>(&address), &length);
  port_ = ntohs(address.sin_port);
  reserve_ = OpenReserve();
}

HubDoor::~HubDoor() {
  close(listener_);
  if (reserve_ >= 0) close(reserve_);
}

std::vector<HubDoor::Guest> HubDoor::Open(int64_t* num_turned_away) {
  std::vector<Guest> guests;
  for (int i = 0; i < kMaxGuestsAtOnce; ++i) {
    sockaddr_in address{};
    socklen_t length = sizeof(address);
    const int fd = accept4(listener_, reinterpret_cast<sockaddr*>(&address), &length, SOCK_NONBLOCK | SOCK_CLOEXEC);
    if (fd >= 0) {
      guests.push_back({fd, ntohl(address.sin_addr.s_addr)});
      continue;
    }
    if (errno == ECONNABORTED || errno == EINTR) continue;
    if ((errno != EMFILE && errno != ENFILE) || reserve_ < 0) break;
    // Whoever is not accepted stays in the listener's queue and would wake it again at once, for ever.
    close(reserve_);
    const int turned_away = accept4(listener_, nullptr, nullptr, SOCK_CLOEXEC);
    if (turned_away >= 0) {
      close(turned_away);
      ++*num_turned_away;
    }
    reserve_ = OpenReserve();
    if (turned_away < 0) break;
  }
  return guests;
}

int RaiseDescriptorLimit() {
  rlimit limit{};
  if (getrlimit(RLIMIT_NOFILE, &limit) != 0) return 1024;
  const rlim_t before = limit.rlim_cur;
  limit.rlim_cur = limit.rlim_max;
  if (setrlimit(RLIMIT_NOFILE, &limit) != 0) limit.rlim_cur = before;
  return static_cast<int>(std::min<rlim_t>(limit.rlim_cur, std::numeric_limits<int>::max()));
}

}  // namespace mapmend
