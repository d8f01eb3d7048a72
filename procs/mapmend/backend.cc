#include "procs/mapmend/backend.h"

#include <unistd.h>

#include <algorithm>
#include <chrono>
#include <filesystem>
#include <fstream>
#include <stdexcept>
#include <thread>

#include "libs/bus/access_token.h"
#include "libs/bus/process.h"
#include "procs/mapmend/bus_plan.h"
#include "procs/mapmend/paths.h"

namespace mapmend {
namespace {

using Clock = std::chrono::steady_clock;
using std::chrono::milliseconds;

constexpr const char* kLauncher = "mapmend";
constexpr const char* kWatched[] = {"submap_store", "merger", "viewer_export", "mosaic", "frontend"};

std::string LogFolder(const BackendOptions& options) {
  return options.logs.empty() ? options.out + "/logs" : options.logs;
}

SupervisorOptions MakeSupervisorOptions(const BackendOptions& options) {
  SupervisorOptions result = options.settings.launcher().supervisor;
  result.log_folder = LogFolder(options);
  return result;
}

// "... hub listening on tcpq://127.0.0.1:PORT" in the hub's log, from byte `from` on; empty while it is not there.
std::string FindHubUrl(const std::string& log_path, long from) {
  std::ifstream log(log_path);
  log.seekg(from);
  const std::string announcement = "hub listening on ";
  for (std::string line; std::getline(log, line);) {
    const size_t at = line.find(announcement);
    if (at == std::string::npos || log.eof()) continue;  // without its end the line may be cut short
    const std::string rest = line.substr(at + announcement.size());
    return rest.substr(0, rest.find_first_of(" \r"));
  }
  return {};
}

}  // namespace

Backend::Backend(const BackendOptions& options)
    : options_(options),
      redirection_(std::make_unique<StderrRedirection>(LogFolder(options) + "/mapmend.log")),
      supervisor_(MakeSupervisorOptions(options)),
      watchdog_(options.settings.launcher().watchdog) {
  ProcessOptions logging;
  logging.log_level = options_.log_level;
  ApplyLogLevel(logging);  // into that file
  BusPlan plan = PlanBus(options_.lcm_url);
  if (!options_.hub_bind.empty()) plan.hub_bind = options_.hub_bind;
  url_ = plan.url;
  has_own_hub_ = plan.start_hub;
  if (plan.start_hub) StartHub(plan.hub_port, plan.hub_bind);
  bus_ = std::make_unique<Bus>(url_, options_.channel_prefix);
  monitor_ = std::make_unique<HealthMonitor>(bus_.get());
  reporter_ = std::make_unique<HealthReporter>(bus_.get(), kLauncher);
  reporter_->SetState("ready");
  if (!options_.with_store) return;
  if (!plan.start_hub) RefuseSharedStore();

  const std::string db = options_.db.empty() ? options_.out + "/map.db" : options_.db;
  std::vector<std::string> store = {FindProgram("submap_store"), "--db", db, "--vocabulary-hash",
                                    options_.vocabulary_hash};
  if (!options_.images.empty()) store.insert(store.end(), {"--images", options_.images});
  StartProcess("submap_store", store, OnExit::kRestart);
  store_started_ = Clock::now();
  WaitUntilReady("submap_store");
  if (options_.when_stored) options_.when_stored(this);
  StartMergerAndViewer();
}

void Backend::StartMergerAndViewer() {
  if (options_.with_merger) {
    std::vector<std::string> merger = {FindProgram("merger"), "--vocabulary", options_.vocabulary};
    if (options_.seed) merger.insert(merger.end(), {"--seed", std::to_string(*options_.seed)});
    StartProcess("merger", merger, OnExit::kRestart);
  }
  // Before the viewer, which reads what it writes, so that it is stopped after it.
  if (options_.with_mosaic)
    StartProcess("mosaic", {FindProgram("mosaic"), "--out", options_.out + "/mosaic.mbtiles"}, OnExit::kRestart,
                 Need::kExtra);
  std::vector<std::string> viewer = {FindProgram("viewer_export"), "--port", std::to_string(options_.port)};
  if (!options_.page_is_stored) viewer.insert(viewer.end(), {"--out", options_.out});
  if (options_.page_is_stored) viewer.emplace_back("--stored");
  if (!options_.page_files.empty()) viewer.insert(viewer.end(), {"--files", options_.page_files});
  if (options_.port > 0 && !options_.page_is_stored) {
    bool is_new = false;
    page_token_ = ReadOrMakeToken(options_.out + "/page.token", &is_new);
    viewer.insert(viewer.end(), {"--page-token-file", options_.out + "/page.token"});
  }
  if (!options_.bind.empty()) viewer.insert(viewer.end(), {"--bind", options_.bind});
  viewer.insert(viewer.end(), options_.export_arguments.begin(), options_.export_arguments.end());
  if (!options_.groundtruth.empty()) {
    viewer.insert(viewer.end(), {"--groundtruth", std::filesystem::absolute(options_.groundtruth).string()});
    viewer.insert(viewer.end(), options_.groundtruth_arguments.begin(), options_.groundtruth_arguments.end());
  }
  if (options_.with_viewer) StartProcess("viewer_export", viewer, OnExit::kRestart, Need::kStart);
  if (options_.with_merger) WaitUntilReady("merger");
  if (options_.with_viewer) WaitUntilReady("viewer_export");
}

Backend::~Backend() = default;

void Backend::StartHub(int port, const std::string& bind) {
  const auto arguments = [&](const std::string& number) {
    std::vector<std::string> argv = {FindProgram("hub"), "--bind", bind, "--port", number};
    if (!options_.hub_token_file.empty()) argv.insert(argv.end(), {"--token-file", options_.hub_token_file});
    const std::vector<std::string> settings = options_.settings.Arguments("hub");
    argv.insert(argv.end(), settings.begin(), settings.end());
    return argv;
  };
  supervisor_.Start({"hub", arguments(std::to_string(port)), OnExit::kRestart});
  const auto deadline = Clock::now() + milliseconds(options_.ready_timeout_ms);
  for (;;) {
    if (StopRequested()) throw Interrupted();
    supervisor_.Tick();
    url_ = FindHubUrl(supervisor_.LogPath("hub"), supervisor_.LogStart("hub"));
    if (!url_.empty()) break;
    if (Clock::now() > deadline) throw std::runtime_error("the hub does not start; see " + supervisor_.LogPath("hub"));
    std::this_thread::sleep_for(milliseconds(5));
  }
  supervisor_.ChangeArguments("hub", arguments(url_.substr(url_.rfind(':') + 1)));
  supervisor_.MarkReady("hub", supervisor_.Pid("hub"));
}

// Two stores on one bus would both acknowledge: whatever is on a bus that is not ours must keep out of our channels.
void Backend::RefuseSharedStore() {
  const auto deadline = Clock::now() + milliseconds(1300);  // health comes once a second
  while (Clock::now() < deadline) {
    if (StopRequested()) throw Interrupted();
    bus_->Handle(100);
    if (monitor_->FindLatest("submap_store") != nullptr) {
      throw std::runtime_error("another run uses " + url_ +
                               " already: choose another --lcm-url, or a --channel-prefix of its own");
    }
  }
}

// Runs that begin at the same moment do not hear of each other before their stores are there.
void Backend::RefuseSecondStore() {
  constexpr milliseconds kBeginning(5000);
  if (!store_started_ || Clock::now() - *store_started_ > kBeginning) return;
  own_stores_.insert(supervisor_.Pid("submap_store"));
  for (const auto& [key, entry] : monitor_->Entries()) {
    const bool is_own = entry.host == HostName() && own_stores_.contains(entry.pid);
    if (entry.process != "submap_store" || is_own || entry.state == "done") continue;
    throw std::runtime_error("another run began on " + url_ +
                             " at the same time, and each would store what both see: choose another --lcm-url, or a "
                             "--channel-prefix of its own, and start again");
  }
}

void Backend::StartProcess(const std::string& name, std::vector<std::string> argv, OnExit on_exit, Need need) {
  const std::vector<std::string> settings = options_.settings.Arguments(name);
  argv.insert(argv.end(), settings.begin(), settings.end());
  argv.insert(argv.end(), {"--lcm-url", url_, "--log-level", options_.log_level});
  if (!options_.channel_prefix.empty()) argv.insert(argv.end(), {"--channel-prefix", options_.channel_prefix});
  supervisor_.Start({name, argv, on_exit, need});
}

void Backend::WaitUntilReady(const std::string& name) {
  const auto deadline = Clock::now() + milliseconds(options_.ready_timeout_ms);
  for (;;) {
    Tick(20);
    const HealthMonitor::Entry* health = Health(name);
    if (health != nullptr && health->state != "starting" && health->state != "error") return;
    if (Clock::now() > deadline) {
      throw std::runtime_error(name + " does not become ready; see " + supervisor_.LogPath(name));
    }
  }
}

void Backend::Tick(int timeout_ms) {
  bus_->Handle(timeout_ms);
  if (StopRequested()) throw Interrupted();
  if (reporter_) reporter_->Tick();
  RefuseSecondStore();
  for (const char* name : kWatched) {
    const HealthMonitor::Entry* health = Health(name);
    if (health != nullptr && health->state != "starting" && health->state != "error")
      supervisor_.MarkReady(name, health->pid);
  }
  LookForHung();
  TellStoreErrors();
  supervisor_.Tick();
  for (const std::string& line : supervisor_.TakeNotices()) Tell(line);
}

// Whoever is silent may only be unheard: as long as the hub does not bring back what the launcher itself says, and
// while the launcher stood still itself, nobody's silence counts but the hub's.
void Backend::LookForHung() {
  const auto now = Watchdog::Clock::now();
  constexpr milliseconds kAbsent(2000), kRoundTrip(3000);
  if (now - last_tick_ > kAbsent) listening_since_ = now;
  last_tick_ = now;
  const HealthMonitor::Entry* own = monitor_->Find(kLauncher, getpid());
  const bool hub_works = own != nullptr && now - own->received < kRoundTrip;
  if (has_own_hub_) {
    const pid_t pid = supervisor_.Pid("hub");
    auto since = std::max(listening_since_, supervisor_.Started("hub"));
    if (own != nullptr) since = std::max(since, own->received);
    if (const std::string why = watchdog_.Judge(pid, since, true, 0); !why.empty()) {
      Tell("hub hangs (" + why + "); it is replaced");
      supervisor_.KillHung("hub");
    }
  }
  if (!hub_works) {
    heard_since_ = now;
    return;
  }
  for (const char* name : kWatched) {
    const pid_t pid = WasStarted(name) ? supervisor_.Pid(name) : -1;
    if (pid < 0) continue;
    const HealthMonitor::Entry* health = monitor_->Find(name, pid);
    auto since = std::max({listening_since_, heard_since_, supervisor_.Started(name)});
    if (health != nullptr) since = std::max(since, health->received);
    const std::string why = watchdog_.Judge(pid, since, health != nullptr, CounterOr(health, "stalled_s", 0));
    if (why.empty()) continue;
    Tell(std::string(name) + " hangs (" + why + "); it is replaced");
    supervisor_.KillHung(name);
    monitor_->Forget(name, pid);
  }
}

void Backend::Tell(const std::string& line) const {
  if (options_.tell) options_.tell(line);
}

// A full disk and the like: what waits is kept by the frontend meanwhile.
void Backend::TellStoreErrors() {
  const HealthMonitor::Entry* store = Health("submap_store");
  if (store == nullptr) return;
  const std::string error = store->state == "error" ? store->message : "";
  if (error == store_error_) return;
  store_error_ = error;
  Tell(error.empty() ? "submap_store: storing again" : error);
}

bool Backend::WasStarted(const std::string& name) const {
  const auto usage = supervisor_.Usage();
  return std::any_of(usage.begin(), usage.end(), [&](const auto& process) { return process.first == name; });
}

const HealthMonitor::Entry* Backend::Health(const std::string& name) const {
  // Names that were not started have no pid to ask for.
  return WasStarted(name) ? monitor_->Find(name, supervisor_.Pid(name)) : nullptr;
}

const HealthMonitor::Entry* Backend::LastWord(const std::string& name, pid_t pid) {
  const auto deadline = Clock::now() + milliseconds(300);
  while (Clock::now() < deadline) {
    const HealthMonitor::Entry* entry = monitor_->Find(name, pid);
    if (entry != nullptr && entry->state == "done") return entry;
    Tick(20);
  }
  return monitor_->Find(name, pid);
}

bool Backend::IsFinished(const std::string& session, int64_t last_seq) const {
  const auto done = [&](const HealthMonitor::Entry* entry) {
    if (entry == nullptr || entry->state != "done") return false;
    const auto cursor = entry->cursors.find(session);
    return cursor != entry->cursors.end() && cursor->second >= last_seq;
  };
  const HealthMonitor::Entry* merger = Health("merger");
  const HealthMonitor::Entry* viewer = Health("viewer_export");
  if (options_.with_merger && supervisor_.IsFailing("merger")) {
    throw std::runtime_error(supervisor_.LastEnd("merger") + "; the flight is in the database: `mapmend merge " +
                             options_.out + "` tries again to make its map");
  }
  const bool with_viewer = options_.with_viewer && !supervisor_.IsFailing("viewer_export");
  if ((options_.with_merger && !done(merger)) || (with_viewer && !done(viewer))) return false;
  if (options_.with_mosaic && !supervisor_.IsFailing("mosaic")) {
    const HealthMonitor::Entry* mosaic = Health("mosaic");
    if (!done(mosaic) || CounterOr(mosaic, "revision", -1) < CounterOr(merger, "revision", -1)) return false;
  }
  if (!options_.with_merger || !with_viewer) return true;
  // The viewer may be done with an earlier revision when a flight is appended to a map.
  return CounterOr(viewer, "revision", -1) >= CounterOr(merger, "revision", -1) ||
         CounterOr(viewer, "revision", -1) < 0;
}

void Backend::HurryRestarts() {
  for (const auto& [name, usage] : supervisor_.Usage()) supervisor_.RestartNow(name);
}

std::string Backend::ExportProblem() const {
  if (!options_.with_viewer) return {};
  if (supervisor_.IsFailing("viewer_export")) return supervisor_.LastEnd("viewer_export");
  const HealthMonitor::Entry* viewer = Health("viewer_export");
  return CounterOr(viewer, "exports_failed", 0) > 0 ? viewer->message : "";
}

std::vector<std::pair<std::string, ResourceUsage>> Backend::StopAll() {
  reporter_.reset();
  monitor_.reset();
  bus_.reset();  // before the hub goes
  supervisor_.StopAll();
  return supervisor_.Usage();
}

}  // namespace mapmend
