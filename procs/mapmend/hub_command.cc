#include <spdlog/spdlog.h>

#include <chrono>
#include <iostream>

#include "libs/bus/hub.h"
#include "libs/bus/process.h"
#include "procs/mapmend/commands.h"

namespace mapmend {

void AddHubCommand(CLI::App* app) {
  CLI::App* command =
      app->add_subcommand("hub", "Exchange messages between processes over TCP (stands in for LCM's TCPService)");
  const auto options = std::make_shared<HubOptions>();
  command->add_option("--port", options->port, "TCP port; 0 picks a free one")->capture_default_str();
  command->add_option("--bind", options->bind, "address to listen on; 0.0.0.0 admits other hosts")
      ->capture_default_str();
  command
      ->add_option("--backpressure-timeout", options->backpressure_timeout_ms,
                   "milliseconds that publishers wait for a subscriber that does not read")
      ->capture_default_str();
  command->callback([options] {
    InstallSignalHandlers();
    Hub hub(*options);
    std::cout << "hub listening on tcpq://" << options->bind << ":" << hub.Port() << std::endl;
    while (!StopRequested()) hub.Spin(200);
    const Hub::Statistics statistics = hub.GetStatistics();
    spdlog::info("hub: {} messages, {} best-effort dropped, {} dropped for stalled subscribers",
                 statistics.num_messages, statistics.num_dropped, statistics.num_dropped_reliable);
  });
}

}  // namespace mapmend
