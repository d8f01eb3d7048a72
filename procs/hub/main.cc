// hub: `mapmend hub`, a program of its own so that it is small.

#include <malloc.h>
#include <spdlog/spdlog.h>

#include <CLI/CLI.hpp>
#include <cstring>
#include <iostream>

#include "libs/bus/access_token.h"
#include "libs/bus/hub.h"
#include "libs/bus/process.h"
#include "libs/command_line/command_line.h"
#include "libs/command_line/option_flags.h"

namespace mapmend {
namespace {

int Main(int argc, char** argv) {
  CLI::App app("Exchange messages between processes over TCP (stands in for LCM's TCPService)", "mapmend hub");
  HubOptions options;
  std::string token_file;
  int64_t buffer_mb = options.max_buffered_bytes >> 20;
  app.add_option("--port", options.port, "TCP port; 0 picks a free one")->capture_default_str();
  app.add_option("--bind", options.bind, "address to listen on; 0.0.0.0 admits other hosts and needs --token-file")
      ->capture_default_str();
  app.add_option(
      "--token-file", token_file,
      "the token that processes of other hosts must show before they may publish; made, readable by its owner "
      "only, if there is no such file");
  app.add_option("--max-clients", options.max_clients, "connections at once")->capture_default_str();
  const auto* buffer = app.add_option("--buffer-mb", buffer_mb, "MB that may wait, over all clients")
                           ->check(CLI::Range(1, 65536))
                           ->capture_default_str();
  app.add_option("--greeting-timeout", options.greeting_timeout_ms,
                 "milliseconds after which a client that has not said what it speaks is disconnected")
      ->capture_default_str();
  app.add_option("--backpressure-timeout", options.backpressure_timeout_ms,
                 "milliseconds that publishers wait for a subscriber that does not read")
      ->capture_default_str();
  AddOptionFlags(&app, "hub", &options);
  // Started as `mapmend hub`, it is listed as that.
  const int skipped = argc > 1 && std::strcmp(argv[1], "hub") == 0 ? 1 : 0;
  if (const auto code = ParseCommandLine(&app, argc - skipped, argv + skipped)) return *code;
  if (buffer->count() > 0) options.max_buffered_bytes = buffer_mb << 20;
  mallopt(M_ARENA_MAX, 1);
  mallopt(M_MMAP_THRESHOLD, 1 << 20);  // what is large goes back to the system at once, and the bound does not grow
  InstallSignalHandlers();
  if (!token_file.empty()) {
    bool made = false;
    options.token = ReadOrMakeToken(token_file, &made);
    std::cout << "hub token " << (made ? "made in " : "read from ") << token_file
              << ": processes of other hosts need a copy of that file" << std::endl;
  }
  Hub hub(options);
  std::cout << "hub listening on tcpq://" << options.bind << ":" << hub.Port() << std::endl;
  while (!StopRequested()) hub.Spin(200);
  const Hub::Statistics statistics = hub.GetStatistics();
  spdlog::info("hub: {} messages, {} best-effort dropped, {} dropped for stalled subscribers, {} without token",
               statistics.num_messages, statistics.num_dropped, statistics.num_dropped_reliable,
               statistics.num_dropped_unauthorised);
  spdlog::info("hub: {} clients refused, {} turned away, {} dead", statistics.num_refused_clients,
               statistics.num_turned_away, statistics.num_dead_clients);
  return 0;
}

}  // namespace
}  // namespace mapmend

int main(int argc, char** argv) { return mapmend::RunMain("mapmend", mapmend::Main, argc, argv); }
