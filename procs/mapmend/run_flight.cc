#include "procs/mapmend/run_flight.h"

#include <signal.h>

#include <chrono>
#include <cstdio>
#include <filesystem>
#include <mapmend/merged_transforms_t.hpp>
#include <memory>
#include <nlohmann/json.hpp>
#include <stdexcept>

#include "libs/bus/channels.h"
#include "libs/bus/event_log.h"
#include "libs/bus/process.h"
#include "libs/bus/stop_request.h"
#include "libs/bus/tree_changes.h"
#include "libs/capture/fingerprint.h"
#include "libs/geometry/write_file.h"
#include "libs/mapping/session_id.h"
#include "procs/mapmend/backend.h"
#include "procs/mapmend/finish_run.h"
#include "procs/mapmend/frontend_arguments.h"
#include "procs/mapmend/lan_addresses.h"
#include "procs/mapmend/out_folder.h"
#include "procs/mapmend/paths.h"
#include "procs/mapmend/progress.h"
#include "procs/mapmend/progress_text.h"
#include "procs/mapmend/recorder.h"
#include "procs/mapmend/run_state.h"
#include "procs/mapmend/session_rescue.h"

namespace mapmend {
namespace {

using Clock = std::chrono::steady_clock;

// A flight's own name: equal input and options give equal streams, down to the name. A flight that joins an existing
// map gets a new one, because the map may hold it already.
std::string SessionOf(const RunOptions& options) {
  if (!options.session.empty()) return options.session;
  if (options.append || options.live) return NewSessionId();
  std::string text = ContentFingerprint(options.inputs);
  for (const std::string& option : {options.skip_frames, options.vehicle}) text += "|" + option;
  for (const auto& number : {options.seed, options.features, options.max_dimension})
    text += "|" + std::to_string(number.value_or(-1));
  for (const auto& number : {options.lost_frames, options.relocalisation_frames}) {
    if (number) text += "|" + std::to_string(*number);
  }
  for (const auto& [name, number] : {std::pair("start", options.start), std::pair("end", options.end)}) {
    if (number) text += std::string("|") + name + std::to_string(*number);
  }
  if (options.every) text += "|every" + std::to_string(*options.every);
  if (!options.mask.empty()) text += "|mask " + SessionIdFromText(ReadFile(options.mask));
  if (options.realtime) text += "|realtime";
  return SessionIdFromText(text);
}

std::string DescribeInputs(const std::vector<std::string>& inputs) {
  return inputs.front() + (inputs.size() > 1 ? " and " + std::to_string(inputs.size() - 1) + " more" : "");
}

std::string DescribeCamera(const RunOptions& options) {
  if (!options.source.empty()) return options.source;
  return "the camera on " + options.channel_prefix +
         (options.image_channel.empty() ? channels::kImage : options.image_channel);
}

std::vector<std::string> GroundTruthArguments(const RunOptions& options) {
  std::vector<std::string> argv;
  if (!options.times.empty()) argv = {"--times", options.times};
  if (options.time_offset) argv.insert(argv.end(), {"--time-offset", std::to_string(*options.time_offset)});
  if (options.time_tolerance) argv.insert(argv.end(), {"--time-tolerance", std::to_string(*options.time_tolerance)});
  return argv;
}

// "; live page http://..." under every address at which it is seen.
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

void AddEvent(const TreeChange& change, int64_t revision, EventLog* events) {
  events->Add(change.joined ? "joined" : "separated", {{"session_a", change.session_a},
                                                       {"submap_a", change.submap_a},
                                                       {"session_b", change.session_b},
                                                       {"submap_b", change.submap_b},
                                                       {"revision", revision}});
}

FlightProgress ReadProgress(const Backend& backend, int num_frames) {
  const auto* frontend = backend.Health("frontend");
  const auto* merger = backend.Health("merger");
  FlightProgress progress;
  progress.frames = CounterOr(frontend, "frames", 0);
  progress.frames_total = CounterOr(frontend, "frames_total", num_frames);
  progress.fps = CounterOr(frontend, "fps", 0);
  progress.submaps = static_cast<int>(CounterOr(frontend, "submaps", 0));
  progress.connections = static_cast<int>(CounterOr(merger, "connections", 0));
  progress.dropped = static_cast<int64_t>(CounterOr(frontend, "frames_dropped", 0));
  progress.refused = static_cast<int64_t>(CounterOr(frontend, "bad_messages", 0));
  if (const auto lost = FindCounter(frontend, "lost_frame")) {
    progress.lost_frame = static_cast<int>(*lost);
    progress.lost_utime = static_cast<int64_t>(CounterOr(frontend, "lost_utime", 0));
    if (const double found = CounterOr(frontend, "found_frame", -1); found >= 0)
      progress.found_frame = static_cast<int>(found);
  }
  if (progress.frames_total > 0) {
    progress.merging_s =
        EstimateMergingSeconds(CounterOr(frontend, "keyframes", 0), progress.frames / progress.frames_total);
  }
  return progress;
}

// Dispatches the bus. In a live flight the first Ctrl-C asks the frontend to finish; the second interrupts.
class FlightEnd {
 public:
  FlightEnd(const RunOptions& options, Backend* backend) : may_land_(options.live), backend_(backend) {}
  void Tick(int timeout_ms) {
    try {
      backend_->Tick(timeout_ms);
    } catch (const Interrupted&) {
      const pid_t frontend = backend_->supervisor()->Pid("frontend");
      if (!may_land_ || frontend <= 0) throw;
      may_land_ = false;
      WithdrawStopRequest();
      kill(frontend, SIGINT);
    }
  }

 private:
  bool may_land_;
  Backend* backend_;
};

// What only the frontend's last health message tells.
void AddFrontendFigures(const HealthMonitor::Entry& frontend, const RunOptions& options, LauncherFigures* figures) {
  const auto counter = [&](const char* name) { return FindCounter(&frontend, name); };
  figures->mode = options.live ? "live" : options.realtime ? "realtime" : "lockstep";
  figures->track_ms_median = counter("track_ms_median");
  figures->track_ms_p95 = counter("track_ms_p95");
  figures->frames_dropped = static_cast<int64_t>(counter("frames_dropped").value_or(0));
  figures->frames_left_out = static_cast<int64_t>(counter("frames_left_out").value_or(0));
  figures->bad_messages = static_cast<int64_t>(counter("bad_messages").value_or(0));
  const std::string untracked = "untracked.";
  for (const auto& [name, value] : frontend.counters) {
    if (name.starts_with(untracked)) figures->untracked[name.substr(untracked.size())] = static_cast<int>(value);
  }
}

}  // namespace

int RunFlight(const RunInputs& inputs) {
  const RunOptions& options = inputs.options;
  const auto start = Clock::now();
  InstallSignalHandlers();
  std::unique_ptr<FreePort> page;  // none with --port 0
  if (options.port.value_or(1) != 0)
    page = std::make_unique<FreePort>(options.port.value_or(8080), options.port.has_value(), "--port");
  const int port = page ? page->Port() : 0;
  const OutFolder out_folder(options.out, options.overwrite, options.append);
  const std::string recording = options.record.empty() ? "" : CheckRecordFolder(options.record, options.overwrite);

  Progress progress(options.quiet || options.json);
  for (const std::string& note : inputs.notes) progress.Say(note);
  std::string complaint, problem;
  int exit_code = 0;
  try {
    BackendOptions backend_options;
    backend_options.out = options.out;
    backend_options.vocabulary = options.vocabulary;
    backend_options.vocabulary_hash = inputs.vocabulary_hash;
    backend_options.groundtruth = options.groundtruth;
    backend_options.groundtruth_arguments = GroundTruthArguments(options);
    backend_options.lcm_url = options.lcm_url;
    backend_options.channel_prefix = options.channel_prefix;
    backend_options.log_level = options.log_level;
    backend_options.seed = options.seed;
    backend_options.port = port;
    backend_options.bind = options.bind;
    std::filesystem::remove(ProfilePath(options));  // of an earlier flight into the same map
    Backend backend(backend_options);
    const std::string session = SessionOf(options);
    progress.Say("mapping " + (options.live ? DescribeCamera(options) : DescribeInputs(options.inputs)) + " into " +
                 options.out + "; bus " + backend.Url() + DescribePage(options.bind, port));
    const BusAddressFile bus_address(options.out, backend.Url());
    EventLog events(EventsPath(options), "mapmend");
    TreeChanges tree;
    const Subscription joins = backend.bus()->Subscribe<merged_transforms_t>(
        channels::kMergedTransforms, Delivery::kKeepAll, [&](const merged_transforms_t& message) {
          for (const TreeChange& change : tree.Update(message)) AddEvent(change, message.revision, &events);
        });
    std::unique_ptr<Recorder> recorder;
    if (!recording.empty()) recorder = std::make_unique<Recorder>(&backend, recording, options.channel_prefix);

    backend.StartProcess("frontend", FrontendArguments(options, session), OnExit::kReport);
    HealthMonitor::Entry frontend;  // its last word
    pid_t frontend_pid = backend.supervisor()->Pid("frontend");
    FlightEnd flight_end(options, &backend);
    double source_news = 0;  // what a camera's reader wants a person to hear
    while (!backend.supervisor()->Status("frontend")) {
      const auto* health = backend.Health("frontend");
      if (health != nullptr) frontend = *health;
      if (const pid_t pid = backend.supervisor()->Pid("frontend"); pid > 0) frontend_pid = pid;
      if (const double news = CounterOr(health, "source_news", 0); news > source_news) {
        source_news = news;
        progress.Say(health->message);
      }
      progress.Show(DescribeFlight(ReadProgress(backend, inputs.num_frames)));
      flight_end.Tick(50);
    }
    const ExitStatus status = *backend.supervisor()->Status("frontend");
    if (const auto* last = backend.LastWord("frontend", frontend_pid); last != nullptr) frontend = *last;
    const bool cut_short = status.signal == 0 && status.code == kExitInputCutShort;
    const auto cursor = frontend.cursors.find(session);
    int64_t last_seq = cursor == frontend.cursors.end() ? -1 : cursor->second;
    if (!status.Success()) {
      complaint = backend.supervisor()->ErrorLine("frontend");
      if (complaint.empty() || status.signal != 0) complaint = "frontend ended with " + status.Describe();
    }
    if (!status.Success() && !cut_short) {
      // Its health may not have said yet that it read anything: the store knows.
      const auto rescued = RescueSession(&backend, session, options.out + "/outbox");
      if (!rescued) throw std::runtime_error(complaint);
      last_seq = *rescued;
      progress.Say(complaint + "; mapping what it has seen");
    }
    const auto merging_since = Clock::now();
    const double estimate_s = EstimateMergingSeconds(CounterOr(&frontend, "keyframes", 0), 1);
    while (!backend.IsFinished(session, last_seq)) {
      const auto* merger = backend.Health("merger");
      const auto counter = [&](const char* name) { return static_cast<int>(CounterOr(merger, name, 0)); };
      progress.Show(DescribeMerging(counter("connections"), counter("edges_accepted"), counter("components"),
                                    estimate_s, std::chrono::duration<double>(Clock::now() - merging_since).count()));
      backend.Tick(50);
    }
    if (recorder) recorder->Finish();

    LauncherFigures figures;
    figures.session = session;
    figures.title = options.title;
    AddFrontendFigures(frontend, options, &figures);
    // A frontend that was killed has not written it.
    if (options.profile && std::filesystem::exists(ProfilePath(options)))
      figures.profile_json = ReadFile(ProfilePath(options));
    figures.readout_ms = FindCounter(backend.Health("merger"), "readout_ms");
    figures.processes = backend.StopAll();
    figures.wall_s = std::chrono::duration<double>(Clock::now() - start).count();
    progress.Say(FinishRun(options.out, figures));
    if (options.json) std::fputs(ReadFile(options.out + "/summary.json").c_str(), stdout);
    std::fflush(stdout);
    if (!complaint.empty()) exit_code = cut_short ? kExitInputCutShort : 1;
    problem = ReadSummary(options.out).value("problem", "");
    if (!problem.empty() && exit_code != 1) exit_code = kExitSmallMap;
  } catch (const Interrupted&) {
    progress.Say("interrupted: " + options.out + "/map.db holds what was mapped so far; `mapmend merge " + options.out +
                 "` makes a map of it");
    return kExitInterrupted;
  }
  if (!complaint.empty()) std::fprintf(stderr, "mapmend: %s; what could be read is mapped\n", complaint.c_str());
  if (!problem.empty()) std::fprintf(stderr, "mapmend: %s\n", problem.c_str());
  return exit_code;
}

}  // namespace mapmend
