#pragma once

#include <sys/types.h>

#include <functional>
#include <new>
#include <string>
#include <vector>

#include "tests/synthetic_stream.h"

// Real processes around a store, for the tests of faults. No threads: so a test can fork.
namespace mapmend {

// A child process; killed, at the latest, with the object, and by the kernel if the test dies.
class TestProcess {
 public:
  TestProcess() = default;
  TestProcess(const std::vector<std::string>& command, const std::string& log_path);
  explicit TestProcess(const std::function<void()>& body);  // forked; exits when body returns
  ~TestProcess();
  TestProcess(TestProcess&& other) noexcept;
  TestProcess& operator=(TestProcess&& other) noexcept;

  void Signal(int signal);
  void Kill();      // SIGKILL, and waits
  int Terminate();  // SIGTERM, and waits; the exit code, -1 if it did not exit by itself
  // The exit code (-1: killed by a signal), or -2 if it still runs after timeout_ms.
  int Wait(int timeout_ms);
  bool IsRunning();
  // Has installed a handler for the signal: one that has only begun would die of it.
  bool Catches(int signal) const;
  pid_t pid() const { return pid_; }

 private:
  pid_t pid_ = -1;
  int exit_code_ = -2;
};

// The programs under test.
std::string ProgramPath(const std::string& name);
// A port nobody listens on at the moment.
int AnyFreePort();
TestProcess StartHub(int port, const std::string& log_path);
TestProcess StartStore(const std::string& db, int port, const std::string& log_path);
std::string HubUrl(int port);
std::string ReadWholeFile(const std::string& path);

// Runs a command to its end; what it printed and its exit code.
struct TestOutput {
  int exit_code = -1;
  std::string output;
};
TestOutput RunProgram(const std::vector<std::string>& command, const std::string& log_path);

void PauseMs(int ms);
// Calls condition every few milliseconds until it holds or timeout_ms have passed.
bool PollUntil(const std::function<bool()>& condition, int timeout_ms);

// What a frontend process of the test says of itself, in memory shared with the test.
struct SharedProgress {
  volatile int64_t appended = -1, acknowledged = -1;
  volatile bool store_reports_error = false;
  volatile double longest_append_ms = 0;  // how long it ever waited in StreamSender::Append
};
SharedProgress* MapSharedProgress();
// Memory that this process shares with those it forks; never freed.
void* MapSharedMemory(size_t size);
template <typename T>
T* MapShared() {
  return new (MapSharedMemory(sizeof(T))) T;
}

// The body of a frontend process: streams the synthetic flight through an outbox, from where that ends, waiting
// `pause_us` after each record, until all is acknowledged.
void RunFrontend(const SyntheticStreamOptions& flight, int port, const std::string& outbox, int pause_us,
                 SharedProgress* progress);

// Digest of the flight's stream as `mapmend db hash` must print it, by a store in this process.
std::string ExpectedStreamHash(const SyntheticStreamOptions& flight, const std::string& scratch_db);

}  // namespace mapmend
