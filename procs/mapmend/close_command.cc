#include <unistd.h>

#include <CLI/CLI.hpp>
#include <cstdio>
#include <memory>
#include <stdexcept>

#include "libs/bus/bus.h"
#include "libs/bus/process.h"
#include "libs/wire/store_client.h"
#include "procs/mapmend/commands.h"

namespace mapmend {
namespace {

struct CloseOptions {
  ProcessOptions process;
  std::vector<std::string> sessions;
};

constexpr int kTimeoutMs = 10000;

FetchAnswer Ask(StoreClient* store, const std::string& url, const FetchRequest& request) {
  auto reply = store->Fetch(request, kTimeoutMs);
  if (!reply) throw std::runtime_error("no store answers on " + url);
  return std::move(*reply);
}

bool HasEnded(StoreClient* store, const std::string& url, const std::string& session) {
  return Ask(store, url, {Addressed(), session, 0, 0, 1}).ended;
}

void Close(CloseOptions options) {
  ApplyLogLevel(options.process);
  const std::string url = ResolveLcmUrl(options.process.lcm_url);
  Bus bus(url, options.process.channel_prefix);
  StoreClient store(&bus, "close-" + std::to_string(getpid()));
  const bool all = options.sessions.empty();
  if (all) {
    for (const StreamCursor& cursor : Ask(&store, url, {}).sessions) options.sessions.push_back(cursor.session);
  }
  int num_refused = 0;
  for (const std::string& session : options.sessions) {
    if (all && HasEnded(&store, url, session)) continue;
    const auto reply = store.CloseSession(session, kTimeoutMs);
    if (!reply) throw std::runtime_error("no store answers on " + url);
    const bool is_closed = reply->status == CloseAnswer::Status::kOk;
    const char* what = is_closed                                               ? "closed"
                       : reply->status == CloseAnswer::Status::kUnknownSession ? "is not in the store"
                                                                               : "still flies, left open";
    std::printf("%s: %s\n", session.c_str(), what);
    if (!is_closed && !all) ++num_refused;
  }
  if (num_refused > 0) throw CLI::RuntimeError(1);
}

}  // namespace

void AddCloseCommand(CLI::App* app) {
  CLI::App* sub =
      app->add_subcommand("close", "End flights whose frontend is gone, so that the map of the others can be finished");
  const auto options = std::make_shared<CloseOptions>();
  options->process.log_level = "error";
  sub->add_option("SESSION", options->sessions, "which ones (default: all that are open and silent)");
  AddProcessOptions(sub, &options->process);
  sub->footer(
      "A flight that turns out to go on, or whose outbox is delivered later, is taken up again.\n"
      "Exit codes: 0 done; 1 an error, told in one line, or a SESSION that flies or is unknown.");
  sub->callback([options] { Close(*options); });
}

}  // namespace mapmend
