#include "procs/mapmend/page_access.h"

#include <vector>

#include "procs/mapmend/backend.h"
#include "procs/mapmend/lan_addresses.h"

namespace mapmend {

std::string DescribePage(const std::string& bind, int port) {
  if (port == 0) return "";
  std::vector<std::string> hosts = {"127.0.0.1"};
  if (bind == "0.0.0.0") {
    const std::vector<std::string> addresses = LanAddresses();
    hosts.insert(hosts.end(), addresses.begin(), addresses.end());
  } else if (!bind.empty()) {
    hosts = {bind};
  }
  std::string text;
  for (const std::string& host : hosts)
    text += (text.empty() ? "; live page http://" : ", http://") + host + ":" + std::to_string(port);
  return text;
}

std::string DescribePageToken(const Backend& backend) {
  return backend.PageToken().empty() ? "" : "; connections can be switched on it with the token " + backend.PageToken();
}

}  // namespace mapmend
