#include "procs/mapmend/run_tool.h"

#include <chrono>
#include <filesystem>
#include <optional>
#include <stdexcept>
#include <thread>

#include "procs/mapmend/paths.h"
#include "procs/mapmend/supervisor.h"

namespace mapmend {
namespace {

// A program that is killed more often is not killed by chance.
constexpr int kMaxAttempts = 10;

// 0 if it is not there.
long SizeOf(const std::string& path) {
  std::error_code missing;
  const uintmax_t size = std::filesystem::file_size(path, missing);
  return missing ? 0 : static_cast<long>(size);
}

ExitStatus RunOnce(const std::vector<std::string>& command, const std::string& log,
                   const std::function<void()>& each_poll) {
  ChildProcess tool(command, log);
  std::optional<ExitStatus> status;
  while (!(status = tool.Poll())) {
    each_poll();
    std::this_thread::sleep_for(std::chrono::milliseconds(5));
  }
  return *status;
}

}  // namespace

ExitStatus RunToEnd(const std::vector<std::string>& argv, const std::string& log,
                    const std::function<void()>& each_poll) {
  std::vector<std::string> command = argv;
  command.front() = FindProgram(argv.front());
  const long begin = SizeOf(log);
  ExitStatus status = RunOnce(command, log, each_poll);
  for (int attempt = 1; status.signal != 0 && attempt < kMaxAttempts; ++attempt) {
    std::filesystem::resize_file(log, static_cast<uintmax_t>(begin));
    status = RunOnce(command, log, each_poll);
  }
  return status;
}

std::string DescribeFailure(const std::string& program, const ExitStatus& status, const std::string& log, long from) {
  if (status.signal != 0) return program + " was ended by " + status.Describe() + ", each time";
  return FindErrorLine(log, program, from);
}

void RunTool(const std::vector<std::string>& argv, const std::string& log, const std::string& failed) {
  const long begin = SizeOf(log);
  const ExitStatus status = RunToEnd(argv, log);
  if (!status.Success()) throw std::runtime_error(failed + ": " + DescribeFailure(argv.front(), status, log, begin));
}

}  // namespace mapmend
