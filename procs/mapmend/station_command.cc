#include <CLI/CLI.hpp>
#include <chrono>
#include <filesystem>
#include <map>
#include <memory>
#include <optional>
#include <set>
#include <stdexcept>
#include <vector>

#include "libs/base/stop_request.h"
#include "libs/base/write_file.h"
#include "libs/bus/channels.h"
#include "libs/bus/process.h"
#include "libs/retrieval/vocabulary.h"
#include "libs/wire/codec.h"
#include "procs/mapmend/backend.h"
#include "procs/mapmend/commands.h"
#include "procs/mapmend/finish_run.h"
#include "procs/mapmend/lan_addresses.h"
#include "procs/mapmend/out_folder.h"
#include "procs/mapmend/page_access.h"
#include "procs/mapmend/paths.h"
#include "procs/mapmend/progress.h"
#include "procs/mapmend/run_flight.h"
#include "procs/mapmend/service_notice.h"
#include "procs/mapmend/session_rescue.h"

namespace mapmend {
namespace {

struct StationOptions {
  std::string out = "mapmend-station", vocabulary, bind = "127.0.0.1", token_file, channel_prefix, log_level = "info";
  int port = 7700;
  std::optional<int> page_port, seed;
  ExportSettings exports;
  ProcessSettings settings;
};

// What the vehicles do, told in lines as their records come by: which flight began, lost tracking, ended.
class FlightBook {
 public:
  FlightBook(Bus* bus, Progress* progress) : progress_(progress) {
    for (const char* channel : {channels::kSession, channels::kSubmap}) {
      subscriptions_.push_back(
          bus->SubscribeRaw(channel, Delivery::kKeepAll, [this, channel](const uint8_t* data, int size) {
            const DecodedRecord decoded = DecodeRecord(channel, data, size);
            if (!decoded.record) throw std::runtime_error(decoded.error);  // the bus counts it as refused
            OnRecord(*decoded.record);
          }));
    }
  }

  int NumOpen() const {
    int open = 0;
    for (const auto& [session, flight] : flights_) open += !flight.ended;
    return open;
  }

 private:
  struct Flight {
    std::string name;
    bool ended = false;
    std::set<int64_t> told;  // records are sent again until they are acknowledged
  };

  // The flight, if it is known and this record of it is new.
  Flight* Find(const RecordHeader& header) {
    const auto it = flights_.find(header.session);
    return it != flights_.end() && it->second.told.insert(header.seq).second ? &it->second : nullptr;
  }

  void OnRecord(const Record& record) {
    const std::string& session = record.header.session;
    if (const auto* started = std::get_if<SessionStarted>(&record.body)) {
      const std::string id = session.substr(0, 8);
      const std::string name = started->vehicle.empty() ? "flight " + id : started->vehicle + " (" + id + ")";
      if (flights_.try_emplace(session, Flight{name, false, {}}).second)
        progress_->Say(name + ": flies " + started->source);
    } else if (const auto* ended = std::get_if<SessionEnded>(&record.body)) {
      Flight* flight = Find(record.header);
      if (flight == nullptr) return;
      flight->ended = true;
      progress_->Say(flight->name + ": has ended after " + std::to_string(ended->num_frames) + " frames");
    } else if (const auto* submap = std::get_if<SubmapEnded>(&record.body)) {
      if (const Flight* flight = Find(record.header)) {
        progress_->Say(flight->name + ": submap " + std::to_string(submap->submap.value) + " ends at frame " +
                       std::to_string(submap->last_frame) + ": " + submap->reason);
      }
    }
  }

  Progress* progress_;
  std::map<std::string, Flight> flights_;
  std::vector<Subscription> subscriptions_;
};

// What to type on board.
std::string DescribeFly(const StationOptions& options) {
  std::vector<std::string> hosts = {options.bind};
  if (options.bind == "0.0.0.0" && !LanAddresses().empty()) hosts = LanAddresses();
  std::string text;
  for (const std::string& host : hosts) {
    text += (text.empty() ? "mapmend fly … --station " : " or ") + host +
            (options.port == 7700 ? "" : ":" + std::to_string(options.port));
  }
  if (!options.token_file.empty()) text += " --token-file TOKEN, a copy of " + options.token_file;
  return text;
}

std::string DescribeMap(const Backend& backend, int num_open) {
  const auto* merger = backend.Health("merger");
  const auto* store = backend.Health("submap_store");
  const auto number = [](const HealthMonitor::Entry* entry, const char* name) {
    return std::to_string(static_cast<int64_t>(CounterOr(entry, name, 0)));
  };
  std::string text = std::to_string(num_open) + " flying  " + number(store, "keyframes") + " keyframes  " +
                     number(merger, "connections") + " connections  " + number(merger, "components") + " components";
  if (merger != nullptr && !merger->message.empty()) text += "  " + merger->message;
  return text;
}

// Everything on the ground: hub, store, merger, live page; until Ctrl-C. Then the flights that no vehicle carries on
// are closed and the map is finished.
class Station {
 public:
  explicit Station(const StationOptions& options) : options_(options) {}

  int Run() {
    const auto start = std::chrono::steady_clock::now();
    InstallSignalHandlers();
    const FreePort page(options_.page_port.value_or(8080), options_.page_port.has_value(), "--page-port");
    const OutFolder folder(options_.out, false, true);
    if (options_.token_file.empty() && !options_.bind.starts_with("127."))
      options_.token_file = options_.out + "/hub.token";
    try {
      std::optional<FlightBook> flights;
      BackendOptions backend_options = MakeOptions(page.Port());
      // Before the merger is there: vehicles may be flying already.
      backend_options.when_stored = [&](Backend* started) { flights.emplace(started->bus(), &progress_); };
      Backend backend(backend_options);
      WriteFile(options_.out + "/logs/lcm-url", backend.Url() + "\n");
      progress_.Say("station: maps into " + options_.out + DescribePage("", page.Port()) + DescribePageToken(backend) +
                    "; on board: " + DescribeFly(options_));
      notice_.Ready();
      while (Tick(&backend)) {
        const std::string state = DescribeMap(backend, flights->NumOpen());
        progress_.Show(state);
        notice_.Alive(state);
      }
      const bool is_whole = Land(&backend);
      LauncherFigures figures;
      const auto* store = backend.Health("submap_store");
      figures.images =
          ImageFigures{static_cast<int>(CounterOr(store, "images_stored", 0)),
                       static_cast<int>(CounterOr(store, "images_awaited", 0) + CounterOr(store, "images_lost", 0))};
      figures.shutter = FindShutter(backend.Health("merger"));
      figures.processes = backend.StopAll();
      figures.wall_s = std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count();
      if (is_whole) progress_.Say(FinishRun(options_.out, figures));
    } catch (const Interrupted&) {
      progress_.Say("interrupted: " + options_.out + "/map.db holds what was mapped so far");
      return kExitInterrupted;
    }
    return 0;
  }

 private:
  BackendOptions MakeOptions(int page_port) {
    if (options_.vocabulary.empty()) options_.vocabulary = DefaultVocabulary();
    if (options_.vocabulary.empty()) throw std::runtime_error("no vocabulary: give one with --vocabulary");
    BackendOptions backend;
    backend.out = options_.out;
    backend.vocabulary = options_.vocabulary;
    backend.vocabulary_hash = Vocabulary::Read(options_.vocabulary).Hash();
    backend.lcm_url = "tcpq://127.0.0.1:" + std::to_string(options_.port);
    backend.hub_bind = options_.bind;
    backend.hub_token_file = options_.token_file;
    backend.channel_prefix = options_.channel_prefix;
    backend.log_level = options_.log_level;
    backend.seed = options_.seed;
    backend.settings = options_.settings;
    backend.with_mosaic = options_.exports.DrawsLive();
    backend.export_arguments = options_.exports.Arguments();
    backend.port = page_port;
    backend.tell = [this](const std::string& line) { progress_.Say(line); };
    return backend;
  }

  // False once Ctrl-C has asked to end.
  bool Tick(Backend* backend) {
    try {
      backend->Tick(100);
      return true;
    } catch (const Interrupted&) {
      WithdrawStopRequest();
      return false;
    }
  }

  // Closes what is dead and waits for the final map. False if no flight came, or a vehicle still flies.
  bool Land(Backend* backend) {
    std::vector<std::string> alive;
    const std::vector<StoredSession> sessions = ListSessions(backend->bus());
    std::vector<StoredSession> closed;
    for (const StoredSession& session : sessions) {
      progress_.Show("closing flights; Ctrl-C leaves at once");
      const auto last = RescueSession(backend, session.id);
      if (last) {
        closed.push_back({session.id, *last});
      } else {
        alive.push_back(session.id.substr(0, 8));
      }
    }
    if (!alive.empty()) {
      std::string list;
      for (const std::string& id : alive) list += (list.empty() ? "" : ", ") + id;
      progress_.Say("still flying: " + list + "; they go on when the station is started again");
      return false;
    }
    for (const StoredSession& session : closed) {
      while (!backend->IsFinished(session.id, session.last_seq)) {
        const auto* merger = backend->Health("merger");
        progress_.Show(merger == nullptr || merger->message.empty() ? "merging" : merger->message);
        notice_.Alive("finishing the map");
        backend->Tick(50);
      }
    }
    if (closed.empty()) progress_.Say("no flight came");
    return !closed.empty();
  }

  StationOptions options_;
  Progress progress_;
  ServiceNotice notice_;
};

}  // namespace

void AddStationCommand(CLI::App* app) {
  CLI::App* sub = app->add_subcommand(
      "station", "On the ground: hub, store, merger and live page for any number of vehicles and flights");
  const auto options = std::make_shared<StationOptions>();
  sub->add_option("--out", options->out, "folder of the map; flights are added to what it holds")
      ->capture_default_str();
  options->exports.AddMosaicOption(sub);
  sub->add_option("--bind", options->bind, "address at which vehicles reach the station; 0.0.0.0: all of this host's")
      ->capture_default_str();
  sub->add_option("--port", options->port, "TCP port for the vehicles")
      ->check(CLI::Range(1, 65535))
      ->capture_default_str();
  sub->add_option(
      "--token-file", options->token_file,
      "what vehicles of other hosts must show; made if there is no such file (default: OUT/hub.token, unless "
      "--bind is this host's own)");
  sub->add_option("--page-port", options->page_port, "of the live page (default: a free one from 8080 on)")
      ->check(CLI::Range(1, 65535));
  sub->add_option("--vocabulary", options->vocabulary, "the vehicles' (default: mapmend's own)");
  sub->add_option("--seed", options->seed, "of everything random (default: the flights')");
  sub->add_option("--channel-prefix", options->channel_prefix, "put before every channel name");
  sub->add_option("--log-level", options->log_level, "of the log files in OUT/logs: debug, info, warn or error")
      ->check(CLI::IsMember({"debug", "info", "warn", "error"}))
      ->capture_default_str();
  options->settings.AddFlags(sub, {"hub", "submap_store", "merger", "viewer_export", "mosaic"});
  sub->footer(
      "Runs until Ctrl-C; then flights whose vehicle is silent are closed and the map is finished. A second Ctrl-C\n"
      "leaves at once. Started again with the same --out, it goes on.");
  sub->callback([options] {
    options->settings.Resolve();
    if (const int code = Station(*options).Run(); code != 0) throw CLI::RuntimeError(code);
  });
}

}  // namespace mapmend
