#pragma once

#include <chrono>
#include <exception>
#include <functional>
#include <memory>
#include <optional>
#include <set>
#include <string>

#include "libs/bus/bus.h"
#include "libs/bus/health.h"
#include "procs/mapmend/health_monitor.h"
#include "procs/mapmend/process_settings.h"
#include "procs/mapmend/stderr_redirection.h"
#include "procs/mapmend/supervisor.h"
#include "procs/mapmend/watchdog.h"

namespace mapmend {

class Backend;

// Ctrl-C or SIGTERM.
struct Interrupted : std::exception {
  const char* what() const noexcept override { return "interrupted"; }
};

struct BackendOptions {
  std::string out;     // folder of results; holds map.db and logs/
  std::string db;      // the database; empty: OUT/map.db
  std::string images;  // the file of its images; empty: beside the database
  std::string logs;    // folder of the log files; empty: OUT/logs
  std::string vocabulary;
  std::string vocabulary_hash;
  std::string groundtruth;                         // empty: none
  std::vector<std::string> groundtruth_arguments;  // of viewer_export, on how to read it
  std::vector<std::string> export_arguments;       // of viewer_export, on formats and frame
  std::string lcm_url;                             // empty: a private hub
  std::string channel_prefix;
  std::string log_level = "info";
  std::optional<int> seed;
  int port = 0;                 // of the live page, 0: none
  std::string bind;             // its address; empty: this host only
  std::string page_files;       // folder that the page shows; empty: OUT
  bool page_is_stored = false;  // it shows a finished map: no exports are written
  bool with_store = true, with_merger = true, with_viewer = true;
  bool with_mosaic = false;    // OUT/mosaic.mbtiles is drawn while the map grows
  std::string hub_bind;        // address that a hub of our own listens on; empty: as lcm_url says
  std::string hub_token_file;  // what processes of other hosts must show to that hub; empty: none
  int ready_timeout_ms = 60000;
  ProcessSettings settings;  // of the processes; resolved
  // Called when hub and store are ready, before merger and viewer are started: what lies in the folder is put in order
  // then.
  std::function<void(Backend*)> when_stored;
  std::function<void(const std::string&)> tell;  // lines for the user while it runs: restarts, a full disk
};

// The processes behind a camera or a log: hub, store, merger, mosaic, viewer; started in this order, each when the one
// before is ready (or has told why it cannot be), kept alive (started again when they end or hang), and stopped in
// reverse order.
class Backend {
 public:
  // Returns once all are ready. Throws std::runtime_error with the line of the process that failed, or Interrupted.
  explicit Backend(const BackendOptions& options);
  ~Backend();

  // Dispatches the bus for up to timeout_ms and looks after the processes. Throws as the constructor does.
  void Tick(int timeout_ms);
  // Starts one more process on the same bus: argv gets its settings, --lcm-url, --channel-prefix and
  // --log-level added.
  void StartProcess(const std::string& name, std::vector<std::string> argv, OnExit on_exit,
                    Need need = Need::kEssential);
  // True once merger, viewer and mosaic (those of them that were started) have finished the whole of a session. A
  // viewer or mosaic that keeps failing is not waited for. Throws std::runtime_error if the merger keeps failing.
  //   last_seq  its last record, -1 if unknown
  bool IsFinished(const std::string& session, int64_t last_seq) const;
  // The flight is over: processes that wait for their next start are started now.
  void HurryRestarts();
  // Why the exports are not all there; empty if they are, or none were wanted.
  std::string ExportProblem() const;
  // A line for the user, now.
  void Tell(const std::string& line) const;

  const std::string& Url() const { return url_; }
  // What one who switches connections on the live page must know; empty: nobody can. It is in OUT/page.token as well.
  const std::string& PageToken() const { return page_token_; }
  const std::string& ChannelPrefix() const { return options_.channel_prefix; }
  Bus* bus() { return bus_.get(); }
  Supervisor* supervisor() { return &supervisor_; }
  // Health of our own process of that name; nullptr before its first word.
  const HealthMonitor::Entry* Health(const std::string& name) const;
  // The last health of a process of ours that has ended: waits a little for it to arrive. nullptr if there is none.
  const HealthMonitor::Entry* LastWord(const std::string& name, pid_t pid);
  // Stops all. Afterwards usage is complete: CPU and memory of every process, in order of start.
  std::vector<std::pair<std::string, ResourceUsage>> StopAll();

 private:
  void StartHub(int port, const std::string& bind);
  void WaitUntilReady(const std::string& name);
  void RefuseSharedStore();
  void RefuseSecondStore();
  void StartMergerAndViewer();
  void LookForHung();
  bool WasStarted(const std::string& name) const;
  void TellStoreErrors();

  BackendOptions options_;
  std::unique_ptr<StderrRedirection> redirection_;  // for what is logged under way
  std::string url_, page_token_;
  Supervisor supervisor_;
  std::unique_ptr<Bus> bus_;
  std::unique_ptr<HealthMonitor> monitor_;
  std::unique_ptr<HealthReporter> reporter_;  // the launcher's own health: it comes back if the hub works
  Watchdog watchdog_;
  bool has_own_hub_ = false;
  Watchdog::Clock::time_point last_tick_, listening_since_, heard_since_;  // since then silence counts
  std::optional<std::chrono::steady_clock::time_point> store_started_;
  std::set<pid_t> own_stores_;  // those that were started again included
  std::string store_error_;     // that was told
};

}  // namespace mapmend
