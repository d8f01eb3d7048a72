#pragma once

#include <netinet/in.h>

namespace mapmend {

// Asks the kernel for BBR (Cardwell et al., ACM Queue 2016) on a connection to another host: it goes by the rate that
// the link shows, where Debian's default, CUBIC, takes each packet that radio loses for a link that is full. Where the
// kernel does not offer it, or not to this user, all stays as it is.
void PreferBbr(int fd, const sockaddr_in& peer);

}  // namespace mapmend
