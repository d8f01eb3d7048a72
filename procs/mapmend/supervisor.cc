#include "procs/mapmend/supervisor.h"

#include <sys/resource.h>

#include <algorithm>
#include <csignal>
#include <filesystem>
#include <fstream>
#include <stdexcept>

#include "libs/base/exit_codes.h"
#include "libs/base/options.h"

namespace mapmend {
namespace {

using std::chrono::milliseconds;

long FileSize(const std::string& path) {
  std::error_code error;
  const auto size = std::filesystem::file_size(path, error);
  return error ? 0 : static_cast<long>(size);
}

double OwnPeakMb() {
  rusage used{};
  getrusage(RUSAGE_SELF, &used);
  return static_cast<double>(used.ru_maxrss) / 1024.0;  // ru_maxrss is in KiB
}

constexpr milliseconds kSampleInterval(100);

}  // namespace

std::string SupervisorOptions::Check() const {
  return log_folder.empty() ? "log_folder is empty" : CheckOptions(*this);
}

std::string SupervisorOptions::Conflict() const {
  return first_backoff_ms <= max_backoff_ms ? "" : "first_backoff_ms must not be more than max_backoff_ms";
}

Supervisor::Supervisor(const SupervisorOptions& options) : options_(options) {
  if (const std::string error = options_.Check(); !error.empty()) throw std::invalid_argument("supervisor: " + error);
}

Supervisor::~Supervisor() { StopAll(); }

Supervisor::Entry& Supervisor::Find(const std::string& name) {
  for (const auto& entry : entries_) {
    if (entry->spec.name == name) return *entry;
  }
  throw std::logic_error("no process " + name);
}

const Supervisor::Entry& Supervisor::Find(const std::string& name) const {
  return const_cast<Supervisor*>(this)->Find(name);
}

std::string Supervisor::LogPath(const std::string& name) const { return options_.log_folder + "/" + name + ".log"; }

void Supervisor::Launch(Entry* entry) {
  const std::string log = LogPath(entry->spec.name);
  entry->log_start = FileSize(log);
  entry->child = std::make_unique<ChildProcess>(entry->spec.argv, log);
  entry->started = Clock::now();
}

void Supervisor::Start(const ProcessSpec& spec) {
  auto entry = std::make_unique<Entry>();
  entry->spec = spec;
  Launch(entry.get());
  entries_.push_back(std::move(entry));
}

void Supervisor::ChangeArguments(const std::string& name, const std::vector<std::string>& argv) {
  Find(name).spec.argv = argv;
}

void Supervisor::MarkReady(const std::string& name, pid_t pid) {
  Entry& entry = Find(name);
  if (entry.child && entry.child->Pid() == pid) entry.was_ready = true;
}

void Supervisor::AddUsage(Entry* entry, const ExitStatus& status) {
  entry->usage.cpu_s += status.usage.cpu_s;
  // What wait4 tells includes the launcher's own pages at the time of the fork: it is the child's only if it is more.
  const double own_peak_mb = OwnPeakMb();
  if (status.usage.peak_rss_mb > own_peak_mb)
    entry->usage.peak_rss_mb = std::max(entry->usage.peak_rss_mb, status.usage.peak_rss_mb);
  entry->usage.peak_rss_mb = std::max(entry->usage.peak_rss_mb, entry->sampled_peak_mb);
}

void Supervisor::SamplePeakMemory(Entry* entry) {
  if (entry->child) entry->sampled_peak_mb = std::max(entry->sampled_peak_mb, entry->child->ReadPeakRssMb());
}

void Supervisor::OnEnd(Entry* entry, const ExitStatus& status) {
  AddUsage(entry, status);
  entry->child.reset();
  const ProcessSpec& spec = entry->spec;
  const bool was_killed = status.signal == SIGKILL;
  if (Clock::now() - entry->started >= milliseconds(options_.stable_after_ms))
    entry->num_quick = entry->num_failures = 0;
  ++entry->num_quick;
  if (!was_killed) ++entry->num_failures;
  if (spec.on_exit == OnExit::kReport ||
      (spec.on_exit == OnExit::kResume && (status.signal == 0 || entry->num_failures > options_.max_crashes))) {
    entry->status = status;
    return;
  }
  const std::string line = FindErrorLine(LogPath(spec.name), spec.name, entry->log_start);
  const std::string why = line.empty() || status.signal != 0 ? spec.name + " ended with " + status.Describe() : line;
  const bool is_for_good = status.signal == 0 && status.code == kExitForGood;
  const bool cannot_start = !entry->was_ready && !was_killed && spec.on_exit == OnExit::kRestart;
  if (is_for_good || (cannot_start && spec.need != Need::kExtra)) throw std::runtime_error(why);
  PlanRestart(entry, why);
}

void Supervisor::PlanRestart(Entry* entry, const std::string& why) {
  const bool is_first = entry->last_end.empty();
  entry->last_end = why;
  int backoff = options_.first_backoff_ms;
  for (int i = 1; i < entry->num_quick && backoff < options_.max_backoff_ms; ++i) backoff *= 2;
  backoff = std::min(backoff, options_.max_backoff_ms);
  if (entry->num_quick > options_.max_quick_restarts && entry->spec.need != Need::kEssential)
    backoff = options_.optional_backoff_ms;
  entry->restart_at = Clock::now() + milliseconds(backoff);
  // Once, then only when it does not end: a process that is killed time and again must not fill the screen.
  if (is_first) notices_.push_back(why + "; it is started again");
  if (entry->num_quick == options_.max_quick_restarts + 1) {
    notices_.push_back(entry->spec.name + " ended " + std::to_string(entry->num_quick) + " times in a row (" + why +
                       "); it is tried again now and then");
  }
}

void Supervisor::Tick() {
  const bool sample = Clock::now() - last_sample_ >= kSampleInterval;
  if (sample) last_sample_ = Clock::now();
  for (const auto& entry : entries_) {
    if (entry->stopped) continue;
    if (sample) SamplePeakMemory(entry.get());
    if (entry->child) {
      if (const auto status = entry->child->Poll()) OnEnd(entry.get(), *status);
    } else if (!entry->status && entry->spec.on_exit != OnExit::kReport && Clock::now() >= entry->restart_at) {
      ++entry->num_restarts;
      Launch(entry.get());
    }
  }
}

void Supervisor::KillHung(const std::string& name) {
  Entry& entry = Find(name);
  if (entry.child) entry.child->Signal(SIGKILL);
}

void Supervisor::RestartNow(const std::string& name) { Find(name).restart_at = Clock::now(); }

bool Supervisor::IsFailing(const std::string& name) const {
  return Find(name).num_failures > options_.max_quick_restarts;
}

std::optional<ExitStatus> Supervisor::Status(const std::string& name) const { return Find(name).status; }

bool Supervisor::IsRunning(const std::string& name) const { return Find(name).child != nullptr; }

pid_t Supervisor::Pid(const std::string& name) const {
  const Entry& entry = Find(name);
  return entry.child ? entry.child->Pid() : -1;
}

int Supervisor::NumRestarts(const std::string& name) const { return Find(name).num_restarts; }

std::string Supervisor::ErrorLine(const std::string& name) const {
  return FindErrorLine(LogPath(name), name, Find(name).log_start);
}

long Supervisor::LogStart(const std::string& name) const { return Find(name).log_start; }

void Supervisor::Stop(const std::string& name) {
  Entry& entry = Find(name);
  entry.stopped = true;
  if (!entry.child) return;
  SamplePeakMemory(&entry);
  const ExitStatus status = entry.child->Stop(options_.stop_grace_ms);
  AddUsage(&entry, status);
  entry.child.reset();
}

void Supervisor::StopAll() {
  for (auto entry = entries_.rbegin(); entry != entries_.rend(); ++entry) Stop((*entry)->spec.name);
}

std::vector<std::pair<std::string, ResourceUsage>> Supervisor::Usage() const {
  std::vector<std::pair<std::string, ResourceUsage>> usage;
  for (const auto& entry : entries_) usage.emplace_back(entry->spec.name, entry->usage);
  return usage;
}

std::string FindErrorLine(const std::string& log_path, const std::string& name, long from) {
  std::ifstream log(log_path);
  log.seekg(from);
  std::string last;
  for (std::string line; std::getline(log, line);) {
    if (line.empty()) continue;
    for (const char* level : {"[error] ", "[critical] "}) {
      const size_t at = line.find(level);
      if (at != std::string::npos) {
        const std::string text = line.substr(at + std::string(level).size());
        return text.starts_with(name + ": ") ? text : name + ": " + text;
      }
    }
    if (line.starts_with(name + ": ")) return line;
    last = line;
  }
  return last.empty() ? last : name + ": " + last;
}

}  // namespace mapmend
