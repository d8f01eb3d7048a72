#include <unistd.h>

#include <CLI/CLI.hpp>
#include <chrono>
#include <csignal>
#include <cstdio>
#include <filesystem>
#include <memory>
#include <stdexcept>
#include <utility>

#include "libs/base/stop_request.h"
#include "libs/base/write_file.h"
#include "libs/bus/process.h"
#include "libs/images/image_sender.h"
#include "libs/stream/session_id.h"
#include "libs/wire/store_client.h"
#include "procs/mapmend/backend.h"
#include "procs/mapmend/bus_plan.h"
#include "procs/mapmend/commands.h"
#include "procs/mapmend/frontend_arguments.h"
#include "procs/mapmend/out_folder.h"
#include "procs/mapmend/progress.h"
#include "procs/mapmend/run_flight.h"
#include "procs/mapmend/run_options.h"
#include "procs/mapmend/service_notice.h"
#include "procs/mapmend/undelivered.h"

namespace mapmend {
namespace {

// For a station that takes no more images.
constexpr auto kImagePatience = std::chrono::seconds(60);

// "HOST", "HOST:PORT" or an LCM URL.
std::string StationUrl(const std::string& station) {
  if (station.find("://") != std::string::npos) return station;
  return "tcpq://" + station + (station.find(':') == std::string::npos ? ":7700" : "");
}

std::string Describe(const HealthMonitor::Entry* frontend, int num_frames, int num_older) {
  const auto number = [&](const char* name) { return static_cast<long long>(CounterOr(frontend, name, 0)); };
  char text[200];
  std::snprintf(text, sizeof(text), "%lld%s frames  %lld tracked  %lld submaps  %d records wait for the station",
                number("frames"), num_frames > 0 ? ("/" + std::to_string(num_frames)).c_str() : "", number("tracked"),
                number("submaps"), frontend == nullptr ? 0 : frontend->queue_depth);
  std::string result = text;
  if (num_older > 0) result += "  " + std::to_string(num_older) + " earlier flights to deliver";
  return result;
}

// What is on board: the frontend, its outbox, and a hub of its own for the camera and the frontend's health, so that
// both are there without the station.
class Flight {
 public:
  Flight(const RunInputs& inputs, const std::string& station)
      : inputs_(inputs), options_(inputs.options), station_url_(StationUrl(station)) {}

  int Run() {
    InstallSignalHandlers();
    const OutFolder folder(options_.out, false, true);
    if (!inputs_.guessed_camera.empty()) WriteFile(options_.camera, inputs_.guessed_camera);
    for (const std::string& note : inputs_.notes) progress_.Say(note);
    try {
      BackendOptions on_board;
      on_board.out = options_.out;
      on_board.lcm_url = options_.lcm_url;
      on_board.channel_prefix = options_.channel_prefix;
      on_board.with_store = false;
      on_board.settings = options_.settings;
      Backend backend(on_board);
      WriteFile(options_.out + "/logs/lcm-url", backend.Url() + "\n");
      const std::string session = options_.session.empty() ? NewSessionId() : options_.session;
      Undelivered older(options_.out, station_url_, options_.channel_prefix, session);
      progress_.Say((options_.live ? "the camera on " + backend.Url() : options_.inputs.front()) +
                    " to the station at " + station_url_ + "; what it has not had waits in " + options_.out);
      const bool is_delivered = Fly(&backend, older, session);
      if (is_delivered) DeliverImages(&backend, session);
      older.EndFlight();
      while (is_delivered && older.NumWaiting() > 0) {
        progress_.Show(std::to_string(older.NumWaiting()) +
                       " earlier flights to deliver; Ctrl-C leaves them for later");
        notice_.Alive("delivering earlier flights");
        backend.Tick(100);
      }
      backend.StopAll();
      return exit_code_;
    } catch (const Interrupted&) {
      progress_.Say("interrupted; `mapmend fly` with the same --out delivers what " + options_.out + " still holds");
      return kExitInterrupted;
    }
  }

 private:
  // True if the station has had all of the flight.
  bool Fly(Backend* backend, const Undelivered& older, const std::string& session) {
    std::vector<std::string> argv = FrontendArguments(options_, session);
    const std::vector<std::string> settings = options_.settings.Arguments("frontend");
    argv.insert(argv.end(), settings.begin(), settings.end());
    argv.insert(argv.end(),
                {"--lcm-url", station_url_, "--local-url", backend->Url(), "--log-level", options_.log_level});
    if (!options_.channel_prefix.empty()) argv.insert(argv.end(), {"--channel-prefix", options_.channel_prefix});
    backend->supervisor()->Start({"frontend", argv, OnExit::kResume});
    notice_.Ready();
    bool may_land = options_.live;
    while (!backend->supervisor()->Status("frontend")) {
      const std::string state = Describe(backend->Health("frontend"), inputs_.num_frames, older.NumWaiting());
      progress_.Show(state);
      notice_.Alive(state);
      try {
        backend->Tick(50);
      } catch (const Interrupted&) {
        const pid_t frontend = backend->supervisor()->Pid("frontend");
        if (!may_land || frontend <= 0) throw;
        may_land = false;
        WithdrawStopRequest();
        kill(frontend, SIGINT);
      }
    }
    const ExitStatus status = *backend->supervisor()->Status("frontend");
    if (status.Success() || (status.signal == 0 && status.code == kExitInputCutShort)) {
      std::error_code ignored;
      std::filesystem::remove(options_.out + "/outbox", ignored);
      progress_.Say("the station has the whole flight");
      exit_code_ = status.code;
      return true;
    }
    std::string complaint = backend->supervisor()->ErrorLine("frontend");
    if (complaint.empty() || status.signal != 0) complaint = "frontend ended with " + status.Describe();
    std::fprintf(stderr, "mapmend: %s\n", complaint.c_str());
    exit_code_ = 1;
    return false;
  }

  // The link comes and goes: whoever has no time stops it, and the next flight goes on.
  void DeliverImages(Backend* backend, const std::string& session) {
    const std::string path = SpoolPathFor(options_.out + "/outbox");
    if (!std::filesystem::exists(path)) return;
    ImageFile spool(path, ImageFile::Mode::kReadWrite);
    ImageSenderOptions sending;
    sending.lcm_url = station_url_;
    sending.channel_prefix = options_.channel_prefix;
    sending.rate_kbit_s = options_.image_rate.value_or(DefaultImageRate(station_url_));
    sending.sessions = {session};
    const ImageSender sender(&spool, sending);
    Bus bus(station_url_, options_.channel_prefix);
    StoreClient store(&bus, "fly-" + std::to_string(getpid()));
    auto last_progress = std::chrono::steady_clock::now();
    size_t before = 0;
    for (;;) {
      // The store has all of the flight: what it does not wait for is not needed.
      const auto status = store.AskImages(session, 1000);
      if (status && status->num_stored + status->num_awaited + status->num_lost > 0 && status->num_awaited == 0) {
        std::vector<KeyframeId> rest;
        for (const ImageFile::Entry& entry : spool.List()) {
          if (entry.session == session) rest.push_back(entry.keyframe);
        }
        spool.Remove(session, rest);
        return;
      }
      const size_t num_left = spool.List().size();
      if (std::exchange(before, num_left) != num_left) last_progress = std::chrono::steady_clock::now();
      if (std::chrono::steady_clock::now() - last_progress > kImagePatience) {
        progress_.Say(std::to_string(num_left) +
                      " images are not delivered yet: the next `mapmend fly` with this --out goes on");
        return;
      }
      const std::string state = std::to_string(num_left) + " images to deliver; Ctrl-C leaves them for later";
      progress_.Show(state);
      notice_.Alive(state);
      backend->Tick(200);
    }
  }

  const RunInputs inputs_;
  const RunOptions& options_ = inputs_.options;
  const std::string station_url_;
  Progress progress_;
  ServiceNotice notice_;
  int exit_code_ = 0;
};

}  // namespace

void AddFlyCommand(CLI::App* app) {
  CLI::App* sub = app->add_subcommand("fly", "On board: track one camera for a `mapmend station` on the ground");
  const auto options = std::make_shared<RunOptions>();
  const auto station = std::make_shared<std::string>(), token_file = std::make_shared<std::string>();
  options->out = "mapmend-fly";
  AddFlightOptions(sub, options.get());
  sub->add_option("--station", *station, "HOST or HOST:PORT of `mapmend station`")->required();
  sub->add_option("--token-file", *token_file,
                  "copy of the station's hub.token (default: the token in $MAPMEND_TOKEN)");
  sub->add_option("--vehicle", options->vehicle, "name of this vehicle, for the report")->required();
  sub->add_option("--out", options->out, "folder that keeps what the station has not had yet")->capture_default_str();
  AddBusOptions(sub, &options->lcm_url, &options->channel_prefix, &options->log_level);
  options->settings.AddFlags(sub, {"frontend", "hub"});
  sub->get_option("--lcm-url")
      ->description(
          "LCM network on board, of the camera with --live (default: tcpq://127.0.0.1:7700 with --live, else a private "
          "hub)");
  sub->footer(
      "Tracking never waits for the station. What it has not had is kept in --out; `mapmend fly` with the same --out\n"
      "delivers it. Exit codes as of `mapmend run`; 0: the station has the whole flight.");
  sub->callback([options, station, token_file] {
    options->settings.Resolve();
    ApplyFollow(options.get());
    ApplyTokenFile(*token_file);
    if (options->live && options->lcm_url.empty()) options->lcm_url = "tcpq://127.0.0.1:7700";
    if (const int code = Flight(CheckRunInputs(*options), *station).Run(); code != 0) throw CLI::RuntimeError(code);
  });
}

}  // namespace mapmend
