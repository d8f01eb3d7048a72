#include "procs/mapmend/run_flight.h"

#include <signal.h>

#include <algorithm>
#include <chrono>
#include <cstdio>
#include <filesystem>
#include <memory>
#include <nlohmann/json.hpp>
#include <stdexcept>

#include "libs/base/event_log.h"
#include "libs/base/stop_request.h"
#include "libs/base/write_file.h"
#include "libs/bus/channels.h"
#include "libs/bus/process.h"
#include "libs/capture/fingerprint.h"
#include "libs/merging/merging_time.h"
#include "libs/stream/session_id.h"
#include "libs/stream/tree_changes.h"
#include "libs/wire/revision_codec.h"
#include "procs/mapmend/backend.h"
#include "procs/mapmend/continue_flight.h"
#include "procs/mapmend/finish_run.h"
#include "procs/mapmend/frontend_arguments.h"
#include "procs/mapmend/image_delivery.h"
#include "procs/mapmend/out_folder.h"
#include "procs/mapmend/page_access.h"
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
  if (!options.image_channel.empty()) text += "|channel " + options.image_channel;
  if (options.every) text += "|every" + std::to_string(*options.every);
  if (!options.mask.empty()) text += "|mask " + SessionIdFromText(ReadFile(options.mask));
  if (options.realtime) text += "|realtime";
  if (const std::string changes = options.settings.Changes("frontend"); !changes.empty()) text += "|options " + changes;
  return SessionIdFromText(text);
}

// The folder holds a map that this flight is added to.
bool KeepsMap(const RunOptions& options) { return options.append || options.continue_flight; }

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
  if (!options.groundtruth_origin.empty())
    argv.insert(argv.end(), {"--groundtruth-origin", options.groundtruth_origin});
  return argv;
}

void AddEvent(const TreeChange& change, int64_t revision, EventLog* events) {
  events->Add(change.joined ? "joined" : "separated", {{"session_a", change.session_a},
                                                       {"submap_a", change.submap_a},
                                                       {"session_b", change.session_b},
                                                       {"submap_b", change.submap_b},
                                                       {"revision", revision}});
}

std::vector<std::string> FlightArguments(const RunOptions& options, const FlightPart& part) {
  std::vector<std::string> argv = FrontendArguments(options, part.session);
  argv.emplace_back("--resume");  // the same arguments start it again should it die
  if (!part.continues.empty()) argv.insert(argv.end(), {"--continues", part.continues});
  if (!part.continues.empty() && !options.live)
    argv.insert(argv.end(), {"--first-frame", std::to_string(part.first_frame)});
  return argv;
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

// Dispatches the bus. In a live flight the first Ctrl-C asks the frontend to finish, or, if it has finished already,
// only says that the map is being made; the second interrupts.
class FlightEnd {
 public:
  FlightEnd(const RunOptions& options, Backend* backend, Progress* progress)
      : may_land_(options.live), backend_(backend), progress_(progress) {}
  void Tick(int timeout_ms) {
    try {
      backend_->Tick(timeout_ms);
    } catch (const Interrupted&) {
      if (!may_land_) throw;
      may_land_ = false;
      WithdrawStopRequest();
      const pid_t frontend = backend_->supervisor()->Pid("frontend");
      if (frontend > 0) kill(frontend, SIGINT);
      progress_->Say(frontend > 0 ? "the flight ends; its map is being made (Ctrl-C again: without)"
                                  : "the flight has ended, its map is being made (Ctrl-C again: without)");
    }
  }

 private:
  bool may_land_;
  Backend* backend_;
  Progress* progress_;
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

// Into a folder that holds a map: what was left behind there first, then where this flight begins.
FlightPart PrepareFolder(const RunOptions& options, const std::string& fresh_session, Backend* backend,
                         Progress* progress) {
  RescueReport report = DeliverOutboxes(backend, options.out);
  FlightPart part;
  part.session = fresh_session;
  if (options.continue_flight) {
    part = FindFlightPart(backend, options, fresh_session);
    report.lines.push_back(part.first_frame > 0
                               ? "going on with the flight at frame " + std::to_string(part.first_frame)
                               : "nothing of this flight is in the map yet: from its beginning");
  }
  const RescueReport closed = CloseSessions(backend, {part.session});
  report.lines.insert(report.lines.end(), closed.lines.begin(), closed.lines.end());
  for (const std::string& line : report.lines) progress->Say(line);
  return part;
}

// A frontend that cannot go on: what it saw becomes a finished map. Throws the complaint if that is nothing.
void RescueAfterDeath(const RunOptions& options, const std::string& complaint, Backend* backend) {
  try {
    RescueFolder(backend, options.out);
  } catch (const std::runtime_error& e) {
    throw std::runtime_error(complaint + "; " + e.what() + ": when that is mended, `mapmend recover " + options.out +
                             "` makes the map of what was seen");
  }
  if (ListSessions(backend->bus()).empty()) throw std::runtime_error(complaint);
}

bool AllFinished(const Backend& backend, const std::vector<StoredSession>& sessions) {
  return std::all_of(sessions.begin(), sessions.end(),
                     [&](const auto& session) { return backend.IsFinished(session.id, session.last_seq); });
}

// Returns the sessions that the map holds.
std::vector<StoredSession> WaitForMap(double num_keyframes, Backend* backend, Progress* progress,
                                      FlightEnd* flight_end) {
  backend->HurryRestarts();
  const auto since = Clock::now();
  const double estimate_s = EstimateMergingSeconds(num_keyframes, 1);
  const auto sessions = ListSessions(backend->bus());
  while (!AllFinished(*backend, sessions)) {
    const auto* merger = backend->Health("merger");
    const auto counter = [&](const char* name) { return static_cast<int>(CounterOr(merger, name, 0)); };
    progress->Show(DescribeMerging(counter("connections"), counter("edges_accepted"), counter("components"), estimate_s,
                                   std::chrono::duration<double>(Clock::now() - since).count()));
    flight_end->Tick(50);
  }
  return sessions;
}

// What the last lines and the exit code say.
struct FlightResult {
  std::string complaint;  // what went wrong; empty: nothing
  std::string problem;    // of the map: it holds too little of the flight
  int exit_code = 0;
};

// One flight, from the start of the processes that map it to its summary.
class MappedFlight {
 public:
  // Starts the backend and puts a folder that holds a map in order.
  //   port       of the live page, 0: none
  //   recording  file of the recording; empty: none
  MappedFlight(const RunInputs& inputs, int port, const std::string& recording, Progress* progress)
      : options_(inputs.options),
        num_frames_(inputs.num_frames),
        progress_(progress),
        part_{SessionOf(options_), "", 0},
        backend_(MakeBackendOptions(inputs, port)),
        bus_address_(options_.out, backend_.Url()),
        events_(EventsPath(options_), "mapmend"),
        joins_(backend_.bus()->Subscribe<MergedTransforms>(channels::kMergedTransforms, Delivery::kKeepAll,
                                                           [this](const MergedTransforms& transforms) {
                                                             for (const TreeChange& change : tree_.Update(transforms))
                                                               AddEvent(change, transforms.revision, &events_);
                                                           })),
        flight_end_(options_, &backend_, progress) {
    progress_->Say("mapping " + (options_.live ? DescribeCamera(options_) : DescribeInputs(options_.inputs)) +
                   " into " + options_.out + "; bus " + backend_.Url() + DescribePage(options_.bind, port) +
                   DescribePageToken(backend_));
    if (!recording.empty()) recorder_ = std::make_unique<Recorder>(&backend_, recording, options_.channel_prefix);
  }

  //   start  of all work, for the time that it took
  FlightResult Run(Clock::time_point start) {
    const ExitStatus status = Fly();
    const bool is_cut_short = status.signal == 0 && status.code == kExitInputCutShort;
    FlightResult result;
    if (!status.Success()) result.complaint = ComplaintOf(status);
    if (!status.Success() && !is_cut_short) {
      RescueAfterDeath(options_, result.complaint, &backend_);
      progress_->Say(result.complaint + "; mapping what it has seen");
    }
    LauncherFigures figures;
    figures.images = FinishMap();
    const std::string export_problem = backend_.ExportProblem();
    AddFigures(&figures);
    figures.wall_s = std::chrono::duration<double>(Clock::now() - start).count();
    if (export_problem.empty()) result.problem = Summarise(figures);
    Judge(is_cut_short, export_problem, &result);
    return result;
  }

 private:
  BackendOptions MakeBackendOptions(const RunInputs& inputs, int port) {
    BackendOptions backend;
    backend.out = options_.out;
    backend.vocabulary = options_.vocabulary;
    backend.vocabulary_hash = inputs.vocabulary_hash;
    backend.groundtruth = options_.groundtruth;
    backend.groundtruth_arguments = GroundTruthArguments(options_);
    backend.lcm_url = options_.lcm_url;
    backend.channel_prefix = options_.channel_prefix;
    backend.log_level = options_.log_level;
    backend.seed = options_.seed;
    backend.settings = options_.settings;
    const ExportSettings exports = options_.exports.WithEarlier(options_.out);
    backend.export_arguments = exports.Arguments();
    backend.with_mosaic = exports.DrawsLive();
    backend.port = port;
    backend.bind = options_.bind;
    backend.tell = [this](const std::string& line) { progress_->Say(line); };
    backend.when_stored = [this](Backend* started) {
      if (KeepsMap(options_)) part_ = PrepareFolder(options_, part_.session, started, progress_);
    };
    return backend;
  }

  // Until the frontend has ended for good; its last word is kept.
  ExitStatus Fly() {
    Supervisor* supervisor = backend_.supervisor();
    backend_.StartProcess("frontend", FlightArguments(options_, part_), OnExit::kResume);
    pid_t pid = supervisor->Pid("frontend");
    double source_news = 0;  // what a camera's reader wants a person to hear
    while (!supervisor->Status("frontend")) {
      const auto* health = backend_.Health("frontend");
      if (health != nullptr) frontend_ = *health;
      if (const pid_t now = supervisor->Pid("frontend"); now > 0) pid = now;
      if (const double news = CounterOr(health, "source_news", 0); news > source_news) {
        source_news = news;
        progress_->Say(health->message);
      }
      progress_->Show(DescribeFlight(ReadProgress(backend_, num_frames_)));
      flight_end_.Tick(50);
      if (recorder_) recorder_->Check();
    }
    if (const auto* last = backend_.LastWord("frontend", pid); last != nullptr) frontend_ = *last;
    return *supervisor->Status("frontend");
  }

  std::string ComplaintOf(const ExitStatus& status) {
    const std::string line = backend_.supervisor()->ErrorLine("frontend");
    return line.empty() || status.signal != 0 ? "frontend ended with " + status.Describe() : line;
  }

  // Waits until the map is made, the images are there and the recording holds what was said.
  ImageFigures FinishMap() {
    ImageDelivery images(&backend_, SpoolPathFor(options_.out + "/outbox"), SessionNames(backend_.bus()));
    const std::vector<StoredSession> sessions =
        WaitForMap(CounterOr(&frontend_, "keyframes", 0), &backend_, progress_, &flight_end_);
    const ImageFigures figures =
        images.Finish([this] { flight_end_.Tick(50); }, [this](const std::string& line) { progress_->Show(line); });
    // Images that came last.
    while (!AllFinished(backend_, sessions)) flight_end_.Tick(50);
    if (recorder_) recorder_->Finish();
    return figures;
  }

  // Stops the processes, and says what they took.
  void AddFigures(LauncherFigures* figures) {
    figures->session = part_.session;
    figures->title = options_.title;
    AddFrontendFigures(frontend_, options_, figures);
    // A frontend that was killed has not written it.
    if (options_.profile && std::filesystem::exists(ProfilePath(options_)))
      figures->profile_json = ReadFile(ProfilePath(options_));
    figures->shutter = FindShutter(backend_.Health("merger"));
    figures->processes = backend_.StopAll();
  }

  // Returns what is wrong with the map.
  std::string Summarise(const LauncherFigures& figures) {
    progress_->Say(FinishRun(options_.out, figures));
    if (options_.json) std::fputs(ReadFile(options_.out + "/summary.json").c_str(), stdout);
    std::fflush(stdout);
    return ReadSummary(options_.out).value("problem", "");
  }

  // Sets the exit code and completes the complaint.
  void Judge(bool is_cut_short, const std::string& export_problem, FlightResult* result) const {
    if (!result->complaint.empty()) {
      result->complaint += "; what could be read is mapped";
      result->exit_code = is_cut_short ? kExitInputCutShort : 1;
    }
    if (!result->problem.empty() && result->exit_code != 1) result->exit_code = kExitSmallMap;
    for (const std::string& loss : {export_problem, recorder_ ? recorder_->Problem() : ""}) {
      if (loss.empty()) continue;
      result->complaint += (result->complaint.empty() ? "" : "; ") + loss;
      result->exit_code = 1;
    }
  }

  const RunOptions& options_;
  const int num_frames_;
  Progress* progress_;
  FlightPart part_;
  Backend backend_;
  const BusAddressFile bus_address_;
  EventLog events_;
  TreeChanges tree_;
  const Subscription joins_;
  std::unique_ptr<Recorder> recorder_;
  FlightEnd flight_end_;
  HealthMonitor::Entry frontend_;  // its last word
};

}  // namespace

int RunFlight(const RunInputs& inputs) {
  const RunOptions& options = inputs.options;
  const auto start = Clock::now();
  InstallSignalHandlers();
  const LivePagePort page(options.port);
  const OutFolder out_folder(options.out, options.overwrite, KeepsMap(options));
  if (!inputs.guessed_camera.empty()) WriteFile(options.camera, inputs.guessed_camera);
  const std::string recording = options.record.empty() ? "" : CheckRecordFolder(options.record, options.overwrite);
  std::filesystem::remove(ProfilePath(options));  // of an earlier flight into the same map

  Progress progress(options.quiet || options.json);
  for (const std::string& note : inputs.notes) progress.Say(note);
  FlightResult result;
  try {
    result = MappedFlight(inputs, page.Port(), recording, &progress).Run(start);
  } catch (const Interrupted&) {
    progress.Say("interrupted: " + options.out + "/map.db holds what was mapped so far; `mapmend recover " +
                 options.out + "` makes its map, the same command with --continue goes on with the flight");
    return kExitInterrupted;
  }
  if (!result.complaint.empty()) std::fprintf(stderr, "mapmend: %s\n", result.complaint.c_str());
  if (!result.problem.empty()) std::fprintf(stderr, "mapmend: %s\n", result.problem.c_str());
  return result.exit_code;
}

}  // namespace mapmend
