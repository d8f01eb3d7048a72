#pragma once

#include <string>

namespace mapmend {

class Backend;

// "; live page http://..." under every address at which it is seen, for a person. Empty without a page (port 0).
//   bind  address on which the page listens; empty: this host only
std::string DescribePage(const std::string& bind, int port);

// "; connections can be switched on it with the token ..."; empty if they cannot.
std::string DescribePageToken(const Backend& backend);

}  // namespace mapmend
