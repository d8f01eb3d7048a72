#pragma once

#include <netinet/in.h>

#include <memory>
#include <string>
#include <vector>

namespace mapmend {

// The IPv4 addresses of a host. A name is looked up by a thread of its own, which is left alone if nobody waits for it
// any more: without a name server a look-up takes half a minute and cannot be ended.
class HostLookup {
 public:
  HostLookup(const std::string& host, int port);

  bool IsDone() const;
  // Empty while it is not done, and if there are none: error then says why.
  std::vector<sockaddr_in> Addresses(std::string* error) const;

 private:
  struct Answer;
  std::shared_ptr<Answer> answer_;
};

}  // namespace mapmend
