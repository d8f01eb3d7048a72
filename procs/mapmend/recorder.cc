#include "procs/mapmend/recorder.h"

#include <unistd.h>

#include <cctype>
#include <chrono>
#include <cstdlib>
#include <filesystem>
#include <sstream>
#include <stdexcept>

namespace mapmend {
namespace {

namespace fs = std::filesystem;
using Clock = std::chrono::steady_clock;
using std::chrono::milliseconds;

// Every channel of ours but that of keyframes' images, which are no part of the stream, as the regular expression
// lcm-logger takes.
std::string ChannelPattern(const std::string& prefix) {
  std::string pattern;
  for (const char c : prefix) {
    if (!std::isalnum(static_cast<unsigned char>(c)) && c != '_') pattern += '\\';
    pattern += c;
  }
  return pattern + "MAPMEND_(KEYFRAME|[^K].*)";
}

}  // namespace

std::string FindOnPath(const std::string& name) {
  const char* path = std::getenv("PATH");
  std::istringstream folders(path == nullptr ? "" : path);
  for (std::string folder; std::getline(folders, folder, ':');) {
    const std::string candidate = folder + "/" + name;
    if (!folder.empty() && access(candidate.c_str(), X_OK) == 0) return candidate;
  }
  return {};
}

std::string CheckRecordFolder(const std::string& folder, bool overwrite) {
  if (FindOnPath("lcm-logger").empty())
    throw std::runtime_error("--record needs lcm-logger: install the package liblcm-bin");
  std::error_code error;
  fs::create_directories(folder, error);
  if (error || access(folder.c_str(), W_OK) != 0) {
    throw std::runtime_error("cannot write to --record " + folder + (error ? ": " + error.message() : ""));
  }
  const std::string path = folder + "/mapmend.lcmlog";
  if (fs::exists(path) && !overwrite)
    throw std::runtime_error(path + " exists already: record into another folder, or give --overwrite");
  fs::remove(path, error);
  return path;
}

Recorder::Recorder(Backend* backend, const std::string& path, const std::string& channel_prefix)
    : backend_(backend), path_(path) {
  // The short form -l of the URL option is refused by lcm-logger 1.3.1; -m: nothing is dropped before a gigabyte waits
  // for the disk.
  backend_->supervisor()->Start(
      {"lcm-logger",
       {FindOnPath("lcm-logger"), "--lcm-url=" + backend_->Url(), "--channel=" + ChannelPattern(channel_prefix),
        "--quiet", "--flush-interval=50", "--max-unwritten-mb=1000", path},
       OnExit::kReport});
  const auto deadline = Clock::now() + milliseconds(10000);
  std::error_code error;
  while (!(fs::file_size(path, error) > 0) || error) {
    backend_->Tick(20);
    if (backend_->supervisor()->Status("lcm-logger")) {
      throw std::runtime_error("cannot record: " + backend_->supervisor()->ErrorLine("lcm-logger"));
    }
    if (Clock::now() > deadline)
      throw std::runtime_error("cannot record: lcm-logger hears nothing on " + backend_->Url());
  }
}

void Recorder::Check() {
  const auto status = backend_->supervisor()->Status("lcm-logger");
  if (!status || !problem_.empty()) return;
  const std::string line = backend_->supervisor()->ErrorLine("lcm-logger");
  problem_ = "the recording " + path_ + " is not whole: " +
             (line.empty() || status->signal != 0 ? "lcm-logger ended with " + status->Describe() : line);
  backend_->Tell(problem_);
}

void Recorder::Finish() {
  const auto end = Clock::now() + milliseconds(300);
  while (Clock::now() < end) backend_->Tick(20);
  Check();
  backend_->supervisor()->Stop("lcm-logger");
}

}  // namespace mapmend
