#include "procs/mapmend/run_state.h"

#include <fcntl.h>
#include <sys/file.h>
#include <unistd.h>

#include <cerrno>
#include <filesystem>
#include <fstream>
#include <nlohmann/json.hpp>
#include <stdexcept>

#include "libs/base/write_file.h"
#include "procs/mapmend/run_summary.h"

namespace mapmend {
namespace {

namespace fs = std::filesystem;

std::string AddressPath(const std::string& out) { return out + "/logs/lcm-url"; }

}  // namespace

bool IsRunning(const std::string& folder) {
  const int fd = open(folder.c_str(), O_RDONLY | O_DIRECTORY | O_CLOEXEC);
  if (fd < 0) return false;
  const bool is_held = flock(fd, LOCK_SH | LOCK_NB) != 0 && errno == EWOULDBLOCK;
  close(fd);
  return is_held;
}

std::string DescribeEnd(const std::string& folder) {
  std::error_code ignored;
  if (!fs::is_directory(folder, ignored)) throw std::runtime_error(folder + ": no such folder");
  if (!fs::exists(folder + "/summary.json", ignored)) {
    if (fs::exists(folder + "/map.db", ignored)) {
      return "the run in " + folder + " ended before its map was finished; `mapmend merge " + folder +
             "` makes a map of what was stored";
    }
    throw std::runtime_error(folder + ": holds no run (neither map.db nor summary.json): name its --out");
  }
  const nlohmann::ordered_json summary = ReadSummary(folder);
  const size_t parts = summary.value("components", nlohmann::ordered_json::array()).size();
  const std::string pieces = parts == 0 ? "no map" : parts == 1 ? "one piece" : std::to_string(parts) + " parts";
  std::string stacks;  // of the merging process, as the paper's Table 1 ends
  if (const auto steps = summary.find("restoration"); steps != summary.end() && !steps->empty()) {
    const auto stack = [&](const char* letters) {
      const std::string text = steps->back().value(letters, "");
      return text.empty() ? std::string("–") : text;
    };
    stacks = "; L1 " + stack("L1_letters") + ", L2 " + stack("L2_letters");
  }
  return "the run in " + folder + " has ended: " + pieces + ", " + std::to_string(summary.value("frames_in_main", 0)) +
         " of " + std::to_string(summary.value("frames_in", 0)) + " frames in the main map" + stacks + "; report " +
         folder + "/report.html";
}

BusAddressFile::BusAddressFile(const std::string& out, const std::string& url) : path_(AddressPath(out)) {
  WriteFile(path_, url + "\n");
}

BusAddressFile::~BusAddressFile() {
  std::error_code ignored;
  fs::remove(path_, ignored);
}

std::string ReadBusAddress(const std::string& out) {
  std::ifstream file(AddressPath(out));
  std::string url;
  if (!(file >> url)) {
    throw std::runtime_error("cannot read " + AddressPath(out) + ": the run in " + out +
                             " has not started its bus yet, or is none of `mapmend run`");
  }
  return url;
}

}  // namespace mapmend
