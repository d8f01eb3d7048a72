#include "libs/bus/congestion.h"

#include <arpa/inet.h>
#include <netinet/tcp.h>
#include <sys/socket.h>

namespace mapmend {

void PreferBbr(int fd, const sockaddr_in& peer) {
  constexpr uint32_t kLoopback = 127;
  if (peer.sin_family != AF_INET || ntohl(peer.sin_addr.s_addr) >> 24 == kLoopback) return;
  static constexpr char kName[] = "bbr";
  setsockopt(fd, IPPROTO_TCP, TCP_CONGESTION, kName, sizeof(kName) - 1);
}

}  // namespace mapmend
