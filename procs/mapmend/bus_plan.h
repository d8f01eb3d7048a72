#pragma once

#include <string>

namespace CLI {
class App;
}  // namespace CLI

// Which LCM network a run uses, and whether it brings its own hub.
namespace mapmend {

struct BusPlan {
  std::string url;  // empty: known only once our own hub has told its port
  bool start_hub = false;
  int hub_port = 0;      // 0: the hub picks a free one
  std::string hub_bind;  // address our hub listens on
};

// url: --lcm-url, else LCM_DEFAULT_URL, else empty: a private hub on a free port, so that two runs do not meet.
//   tcpq://HOST:PORT  a hub that answers there is used; if nothing listens and HOST is this host, we start one
//   udpm://...        used as it is
// Throws std::runtime_error with one line if something else than an LCM hub listens there, or the URL is of another
// kind.
BusPlan PlanBus(const std::string& url);

// The same for a given option: falls back to the environment variable LCM_DEFAULT_URL.
std::string UrlFromOptionOrEnvironment(const std::string& option);

// Adds --lcm-url, --channel-prefix and --log-level to a subcommand that starts processes.
void AddBusOptions(CLI::App* sub, std::string* lcm_url, std::string* channel_prefix, std::string* log_level);

}  // namespace mapmend
