#include "procs/mapmend/child_process.h"

#include <fcntl.h>
#include <sys/prctl.h>
#include <sys/resource.h>
#include <sys/wait.h>
#include <unistd.h>

#include <cerrno>
#include <chrono>
#include <csignal>
#include <cstdlib>
#include <cstring>
#include <fstream>
#include <stdexcept>
#include <thread>

namespace mapmend {
namespace {

double Seconds(const timeval& time) {
  return static_cast<double>(time.tv_sec) + static_cast<double>(time.tv_usec) * 1e-6;
}

// Runs in the child between fork and exec: only async-signal-safe calls.
[[noreturn]] void ExecChild(char* const* argv, int input, int log, int failure_pipe, pid_t parent) {
  setpgid(0, 0);
  prctl(PR_SET_PDEATHSIG, SIGTERM);
  if (getppid() != parent) _exit(127);  // the launcher died before the line above
  sigset_t none;
  sigemptyset(&none);
  sigprocmask(SIG_SETMASK, &none, nullptr);
  std::signal(SIGINT, SIG_DFL);
  std::signal(SIGTERM, SIG_DFL);
  dup2(input, STDIN_FILENO);
  dup2(log, STDOUT_FILENO);
  dup2(log, STDERR_FILENO);
  execv(argv[0], argv);
  const int error = errno;
  [[maybe_unused]] const ssize_t written = write(failure_pipe, &error, sizeof(error));
  _exit(127);
}

}  // namespace

std::string ExitStatus::Describe() const {
  if (signal != 0) return "signal " + std::to_string(signal) + " (" + strsignal(signal) + ")";
  return "exit code " + std::to_string(code);
}

ChildProcess::ChildProcess(const std::vector<std::string>& argv, const std::string& log_path) {
  std::vector<std::string> words = argv;
  std::vector<char*> pointers;
  for (std::string& word : words) pointers.push_back(word.data());
  pointers.push_back(nullptr);

  const int log = open(log_path.c_str(), O_WRONLY | O_CREAT | O_APPEND | O_CLOEXEC, 0644);
  if (log < 0) throw std::runtime_error("cannot write " + log_path + ": " + std::strerror(errno));
  const int input = open("/dev/null", O_RDONLY | O_CLOEXEC);
  // The pipe closes by itself when exec succeeds, and carries errno when it fails.
  int failure[2] = {-1, -1};
  if (input < 0 || pipe2(failure, O_CLOEXEC) != 0) {
    throw std::runtime_error(std::string("cannot start a process: ") + std::strerror(errno));
  }
  const pid_t parent = getpid();
  setenv("MAPMEND_PARENT", std::to_string(parent).c_str(), 1);
  pid_ = fork();
  if (pid_ == 0) ExecChild(pointers.data(), input, log, failure[1], parent);
  const int fork_error = errno;
  close(log);
  close(input);
  close(failure[1]);
  int exec_error = 0;
  const bool failed = pid_ > 0 && read(failure[0], &exec_error, sizeof(exec_error)) == sizeof(exec_error);
  close(failure[0]);
  if (pid_ < 0) throw std::runtime_error(std::string("cannot start a process: ") + std::strerror(fork_error));
  if (failed) {
    waitpid(pid_, nullptr, 0);
    throw std::runtime_error("cannot start " + argv[0] + ": " + std::strerror(exec_error));
  }
}

ChildProcess::~ChildProcess() {
  if (status_) return;
  Signal(SIGKILL);
  waitpid(pid_, nullptr, 0);
}

std::optional<ExitStatus> ChildProcess::Poll() {
  if (status_) return status_;
  int raw = 0;
  rusage used{};
  pid_t result = 0;
  do {
    result = wait4(pid_, &raw, WNOHANG, &used);
  } while (result < 0 && errno == EINTR);
  if (result == 0) return std::nullopt;
  ExitStatus status;
  if (result == pid_) {
    if (WIFSIGNALED(raw))
      status.signal = WTERMSIG(raw);
    else
      status.code = WEXITSTATUS(raw);
    status.usage.cpu_s = Seconds(used.ru_utime) + Seconds(used.ru_stime);
    status.usage.peak_rss_mb = static_cast<double>(used.ru_maxrss) / 1024.0;  // ru_maxrss is in KiB
  } else {
    status.code = 127;  // somebody else has reaped it
  }
  status_ = status;
  return status_;
}

double ChildProcess::ReadPeakRssMb() const {
  if (status_) return 0;
  std::ifstream file("/proc/" + std::to_string(pid_) + "/status");
  const std::string key = "VmHWM:";
  for (std::string line; std::getline(file, line);) {
    if (line.starts_with(key)) return std::strtod(line.c_str() + key.size(), nullptr) / 1024.0;  // in KiB
  }
  return 0;
}

void ChildProcess::Signal(int signal) {
  if (!status_) kill(pid_, signal);
}

ExitStatus ChildProcess::Stop(int grace_ms) {
  using Clock = std::chrono::steady_clock;
  Signal(SIGTERM);
  const auto deadline = Clock::now() + std::chrono::milliseconds(grace_ms);
  bool killed = false;
  for (;;) {
    if (const auto status = Poll()) return *status;
    if (!killed && Clock::now() >= deadline) {
      Signal(SIGKILL);
      killed = true;
    }
    std::this_thread::sleep_for(std::chrono::milliseconds(5));
  }
}

}  // namespace mapmend
