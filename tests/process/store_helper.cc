#include "tests/process/store_helper.h"

#include <arpa/inet.h>
#include <fcntl.h>
#include <netinet/in.h>
#include <spdlog/spdlog.h>
#include <sys/mman.h>
#include <sys/prctl.h>
#include <sys/socket.h>
#include <sys/wait.h>
#include <unistd.h>

#include <chrono>
#include <csignal>
#include <cstdlib>
#include <fstream>
#include <sstream>
#include <thread>

#include "libs/bus/bus.h"
#include "libs/wire/codec.h"
#include "libs/wire/stream_sender.h"
#include "procs/submap_store/db_commands.h"
#include "procs/submap_store/submap_store.h"

namespace mapmend {
namespace {

void DieWithParent() {
  prctl(PR_SET_PDEATHSIG, SIGKILL);
  if (getppid() == 1) _exit(1);
}

void RedirectTo(const std::string& log_path) {
  const int fd = open(log_path.c_str(), O_WRONLY | O_CREAT | O_APPEND, 0644);
  dup2(fd, STDOUT_FILENO);
  dup2(fd, STDERR_FILENO);
  close(fd);
}

}  // namespace

TestProcess::TestProcess(const std::vector<std::string>& command, const std::string& log_path) {
  pid_ = fork();
  if (pid_ != 0) return;
  DieWithParent();
  RedirectTo(log_path);
  std::vector<char*> argv;
  for (const std::string& word : command) argv.push_back(const_cast<char*>(word.c_str()));
  argv.push_back(nullptr);
  execv(argv[0], argv.data());
  _exit(127);
}

TestProcess::TestProcess(const std::function<void()>& body) {
  pid_ = fork();
  if (pid_ != 0) return;
  DieWithParent();
  RedirectTo("/dev/null");
  try {
    body();
  } catch (const std::exception&) {
    _exit(3);
  }
  _exit(0);
}

TestProcess::~TestProcess() { Kill(); }

TestProcess::TestProcess(TestProcess&& other) noexcept : pid_(other.pid_), exit_code_(other.exit_code_) {
  other.pid_ = -1;
}

TestProcess& TestProcess::operator=(TestProcess&& other) noexcept {
  Kill();
  pid_ = other.pid_;
  exit_code_ = other.exit_code_;
  other.pid_ = -1;
  return *this;
}

void TestProcess::Signal(int signal) {
  if (pid_ > 0) kill(pid_, signal);
}

void TestProcess::Kill() {
  Signal(SIGKILL);
  Wait(10000);
}

int TestProcess::Terminate() {
  Signal(SIGTERM);
  return Wait(10000);
}

int TestProcess::Wait(int timeout_ms) {
  PollUntil([this] { return !IsRunning(); }, timeout_ms);
  return exit_code_;
}

bool TestProcess::Catches(int signal) const {
  std::ifstream status("/proc/" + std::to_string(pid_) + "/status");
  for (std::string line; std::getline(status, line);) {
    if (line.starts_with("SigCgt:")) return (std::stoull(line.substr(7), nullptr, 16) >> (signal - 1) & 1) != 0;
  }
  return false;
}

bool TestProcess::IsRunning() {
  if (pid_ <= 0) return false;
  int status = 0;
  if (waitpid(pid_, &status, WNOHANG) != pid_) return true;
  exit_code_ = WIFEXITED(status) ? WEXITSTATUS(status) : -1;
  pid_ = -1;
  return false;
}

std::string ProgramPath(const std::string& name) { return std::string(MAPMEND_BIN_DIR) + "/" + name; }

int AnyFreePort() {
  const int fd = socket(AF_INET, SOCK_STREAM | SOCK_CLOEXEC, 0);
  sockaddr_in address{};
  address.sin_family = AF_INET;
  address.sin_addr.s_addr = htonl(INADDR_LOOPBACK);
  socklen_t length = sizeof(address);
  if (bind(fd, reinterpret_cast<sockaddr*>(&address), length) != 0) return 0;
  getsockname(fd, reinterpret_cast<sockaddr*>(&address), &length);
  close(fd);
  return ntohs(address.sin_port);
}

std::string HubUrl(int port) { return "tcpq://127.0.0.1:" + std::to_string(port); }

TestProcess StartHub(int port, const std::string& log_path) {
  return TestProcess({ProgramPath("mapmend"), "hub", "--port", std::to_string(port)}, log_path);
}

TestProcess StartStore(const std::string& db, int port, const std::string& log_path) {
  return TestProcess({ProgramPath("submap_store"), "--db", db, "--lcm-url", HubUrl(port)}, log_path);
}

std::string ReadWholeFile(const std::string& path) {
  std::ifstream in(path, std::ios::binary);
  std::stringstream text;
  text << in.rdbuf();
  return text.str();
}

TestOutput RunProgram(const std::vector<std::string>& command, const std::string& log_path) {
  unlink(log_path.c_str());
  TestProcess child(command, log_path);
  TestOutput result;
  result.exit_code = child.Wait(60000);
  result.output = ReadWholeFile(log_path);
  return result;
}

void PauseMs(int ms) { usleep(static_cast<useconds_t>(ms) * 1000); }

bool PollUntil(const std::function<bool()>& condition, int timeout_ms) {
  const auto deadline = std::chrono::steady_clock::now() + std::chrono::milliseconds(timeout_ms);
  while (!condition()) {
    if (std::chrono::steady_clock::now() >= deadline) return false;
    PauseMs(5);
  }
  return true;
}

void* MapSharedMemory(size_t size) {
  return mmap(nullptr, size, PROT_READ | PROT_WRITE, MAP_SHARED | MAP_ANONYMOUS, -1, 0);
}

SharedProgress* MapSharedProgress() { return MapShared<SharedProgress>(); }

void RunFrontend(const SyntheticStreamOptions& flight, int port, const std::string& outbox, int pause_us,
                 SharedProgress* progress) {
  spdlog::set_level(spdlog::level::off);
  Bus bus(HubUrl(port), "");
  StreamSenderOptions options;
  options.outbox_path = outbox;
  StreamSender sender(&bus, flight.session, options);
  const auto publish_progress = [&] {
    progress->acknowledged = sender.AcknowledgedSeq();
    progress->store_reports_error = !sender.StoreError().empty();
  };
  SyntheticStream stream(flight);
  int64_t utime = 0;
  RecordBody body;
  for (int64_t seq = 0; stream.Next(&utime, &body); ++seq) {
    if (seq <= sender.LastSeq()) continue;  // an earlier life of this frontend made it
    const auto begin = std::chrono::steady_clock::now();
    sender.Append(utime, std::move(body));
    const std::chrono::duration<double, std::milli> took = std::chrono::steady_clock::now() - begin;
    if (took.count() > progress->longest_append_ms) progress->longest_append_ms = took.count();
    progress->appended = seq;
    publish_progress();
    if (pause_us > 0) usleep(static_cast<useconds_t>(pause_us));
  }
  while (sender.AcknowledgedSeq() < sender.LastSeq()) {
    publish_progress();
    PauseMs(5);
  }
  publish_progress();
}

std::string ExpectedStreamHash(const SyntheticStreamOptions& flight, const std::string& scratch_db) {
  SubmapStoreOptions options;
  options.path = scratch_db;
  {
    SubmapStore store(options);
    SyntheticStream stream(flight);
    Record record;
    record.header.session = flight.session;
    for (record.header.seq = 0; stream.Next(&record.header.utime, &record.body); ++record.header.seq) {
      const EncodedRecord encoded = EncodeRecord(record);
      store.OnRecord(encoded.channel, encoded.data.data(), static_cast<int>(encoded.data.size()), 0);
      if (record.header.seq % 50 == 0) store.CommitReady(0);
    }
    store.CommitReady(0);
    while (store.WorkInBackground()) continue;
  }
  return HashDb(scratch_db).stream;
}

}  // namespace mapmend
