#include "tests/process/command_helper.h"

#include <fcntl.h>
#include <gtest/gtest.h>
#include <sys/wait.h>
#include <unistd.h>

#include <atomic>
#include <chrono>
#include <csignal>
#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <sstream>
#include <thread>

namespace mapmend {
namespace {

namespace fs = std::filesystem;

std::string NewMark() {
  static std::atomic<int> count{0};
  return "MAPMEND_TEST_MARK=" + std::to_string(getpid()) + "." + std::to_string(++count) + ".";
}

bool IsZombie(const std::string& proc) {
  const std::string stat = ReadText(proc + "/stat");
  const size_t end = stat.rfind(')');
  return end != std::string::npos && end + 2 < stat.size() && stat[end + 2] == 'Z';
}

}  // namespace

std::string ReadText(const std::string& path) {
  std::ifstream file(path, std::ios::binary);
  std::ostringstream text;
  text << file.rdbuf();
  return text.str();
}

void SleepSeconds(double seconds) { std::this_thread::sleep_for(std::chrono::duration<double>(seconds)); }

RunningCommand::RunningCommand(const std::vector<std::string>& argv, const std::string& output_path)
    : mark_(NewMark()), output_path_(output_path) {
  std::vector<std::string> words = argv;
  std::vector<char*> arguments, environment;
  for (std::string& word : words) arguments.push_back(word.data());
  arguments.push_back(nullptr);
  for (char** variable = environ; *variable != nullptr; ++variable) {
    const std::string text = *variable;
    if (!text.starts_with("LCM_DEFAULT_URL=") && !text.starts_with("MAPMEND_PARENT=")) environment.push_back(*variable);
  }
  std::string mark = mark_;
  environment.push_back(mark.data());
  environment.push_back(nullptr);
  pid_ = fork();
  if (pid_ == 0) {
    const int input = open("/dev/null", O_RDONLY);
    const int output = open(output_path_.c_str(), O_WRONLY | O_CREAT | O_TRUNC, 0644);
    dup2(input, STDIN_FILENO);
    dup2(output, STDOUT_FILENO);
    dup2(output, STDERR_FILENO);
    execve(arguments[0], arguments.data(), environment.data());
    _exit(127);
  }
}

RunningCommand::~RunningCommand() {
  for (const pid_t pid : Survivors()) kill(pid, SIGKILL);
  if (!result_ && pid_ > 0) waitpid(pid_, nullptr, 0);
}

void RunningCommand::Signal(int signal) { kill(pid_, signal); }

std::optional<CommandResult> RunningCommand::Wait(double timeout_s) {
  int status = 0;
  const bool ended = result_ || WaitUntil([&] { return waitpid(pid_, &status, WNOHANG) == pid_; }, timeout_s);
  if (!ended) return std::nullopt;
  if (!result_) {
    result_.emplace();
    if (WIFEXITED(status)) result_->exit_code = WEXITSTATUS(status);
    if (WIFSIGNALED(status)) result_->signal = WTERMSIG(status);
  }
  result_->output = ReadText(output_path_);
  return result_;
}

std::vector<pid_t> RunningCommand::Survivors() const {
  std::vector<pid_t> pids;
  for (const auto& entry : fs::directory_iterator("/proc")) {
    const std::string name = entry.path().filename().string();
    if (name.find_first_not_of("0123456789") != std::string::npos) continue;
    if (ReadText(entry.path().string() + "/environ").find(mark_) == std::string::npos ||
        IsZombie(entry.path().string()))
      continue;
    pids.push_back(std::stoi(name));
  }
  return pids;
}

std::vector<pid_t> RunningCommand::SurvivorsAfter(double timeout_s) const {
  WaitUntil([&] { return Survivors().empty(); }, timeout_s);
  return Survivors();
}

CommandResult RunCommand(const std::vector<std::string>& argv, double timeout_s) {
  const TemporaryFolder folder;
  RunningCommand command(argv, folder / "output");
  const auto result = command.Wait(timeout_s);
  if (!result) {
    ADD_FAILURE() << argv[0] << " has not ended after " << timeout_s << " s:\n" << ReadText(folder / "output");
    return {};
  }
  EXPECT_EQ(command.Survivors(), std::vector<pid_t>()) << argv[0] << " left processes running";
  return *result;
}

TemporaryFolder::TemporaryFolder() {
  std::string pattern = (fs::temp_directory_path() / "mapmend_test_XXXXXX").string();
  if (mkdtemp(pattern.data()) == nullptr) throw std::runtime_error("cannot make a temporary folder");
  path_ = pattern;
}

TemporaryFolder::~TemporaryFolder() {
  std::error_code ignored;
  fs::remove_all(path_, ignored);
}

pid_t FindProcess(const RunningCommand& run, const std::string& program) {
  // With the slash and the NUL about it, so that only the program itself is meant.
  const std::string word = "/" + program + std::string(1, '\0');
  for (const pid_t pid : run.Survivors()) {
    if (pid != run.Pid() && ReadText("/proc/" + std::to_string(pid) + "/cmdline").find(word) != std::string::npos)
      return pid;
  }
  return -1;
}

void KillAndAwaitReturn(const RunningCommand& run, const std::string& program) {
  pid_t pid = -1;
  ASSERT_TRUE(WaitUntil([&] { return (pid = FindProcess(run, program)) > 0; }, 60)) << program;
  kill(pid, SIGKILL);
  const auto has_returned = [&] {
    const pid_t next = FindProcess(run, program);
    return next > 0 && next != pid;
  };
  ASSERT_TRUE(WaitUntil(has_returned, 60)) << program;
}

}  // namespace mapmend
