#include <sys/statvfs.h>
#include <unistd.h>

#include <CLI/CLI.hpp>
#include <cstdio>
#include <fstream>
#include <functional>
#include <memory>
#include <nlohmann/json.hpp>
#include <sstream>
#include <stdexcept>
#include <string>

#include "libs/retrieval/vocabulary.h"
#include "procs/mapmend/bus_plan.h"
#include "procs/mapmend/commands.h"
#include "procs/mapmend/out_folder.h"
#include "procs/mapmend/paths.h"
#include "procs/mapmend/recorder.h"

namespace mapmend {
namespace {

struct DoctorOptions {
  std::string lcm_url, vocabulary, out = ".";
  bool json = false;
};

struct Finding {
  enum class Level { kOk, kNote, kProblem } level = Level::kOk;
  std::string text;
};

Finding Ok(const std::string& text) { return {Finding::Level::kOk, text}; }
Finding Note(const std::string& text) { return {Finding::Level::kNote, text}; }
Finding Problem(const std::string& text) { return {Finding::Level::kProblem, text}; }

Finding CheckPrograms() {
  for (const char* name : {"hub", "frontend", "submap_store", "merger", "viewer_export", "mosaic"}) FindProgram(name);
  return Ok("hub, frontend, submap_store, merger, viewer_export and mosaic are found from " + ProgramFolder().string());
}

Finding CheckProcessor() {
  std::ifstream cpuinfo("/proc/cpuinfo");
  std::stringstream text;
  text << cpuinfo.rdbuf();
  if (text.str().find(" popcnt") == std::string::npos)
    return Problem("the processor lacks popcnt (mapmend is built for x86-64-v2)");
  return Ok(std::to_string(sysconf(_SC_NPROCESSORS_ONLN)) + " cores");
}

Finding CheckVocabularyFile(const std::string& given) {
  const std::string path = given.empty() ? DefaultVocabulary() : given;
  if (path.empty()) return Problem("vocabulary/mapmend.voc is missing from mapmend's data");
  const Vocabulary vocabulary = Vocabulary::Read(path);
  return Ok(path + ": " + std::to_string(vocabulary.NumWords()) + " words, hash " + vocabulary.Hash());
}

Finding CheckBus(const std::string& url) {
  const BusPlan plan = PlanBus(url);
  if (!plan.start_hub) return Ok(url + (url.starts_with("udpm") ? "" : ": a hub answers"));
  if (url.empty()) return Ok("no LCM URL is set: each run brings a private hub on a free port");
  return Ok(url + ": free; a run would start its hub there");
}

// udpm needs a route for 224.0.0.0/4 or a default route.
Finding CheckMulticast() {
  std::ifstream routes("/proc/net/route");  // little-endian hexadecimal: interface destination gateway flags ... mask
  std::string line;
  std::getline(routes, line);
  while (std::getline(routes, line)) {
    std::istringstream fields(line);
    std::string interface, destination;
    fields >> interface >> destination;
    if (destination == "000000E0" || destination == "00000000") return Ok("route for multicast through " + interface);
  }
  return Note("no route for multicast: only tcpq:// works; for udpm:// on one host: ip route add 224.0.0.0/4 dev lo");
}

Finding CheckReceiveBuffer() {
  long bytes = 0;
  std::ifstream("/proc/sys/net/core/rmem_max") >> bytes;
  if (bytes >= 4194304) return Ok("udpm may have a receive buffer of " + std::to_string(bytes) + " bytes");
  return Note("for udpm://, allow a receive buffer of 4 MB (sysctl -w net.core.rmem_max=4194304; now " +
              std::to_string(bytes) + ") and add recv_buf_size=4194304 to the URL");
}

Finding CheckDisk(const std::string& folder) {
  struct statvfs disk {};
  if (statvfs(folder.c_str(), &disk) != 0 || access(folder.c_str(), W_OK) != 0)
    return Problem(folder + " cannot be written");
  const double free_gb = static_cast<double>(disk.f_bavail) * static_cast<double>(disk.f_frsize) / 1e9;
  char text[64];
  std::snprintf(text, sizeof(text), ": %.1f GB free", free_gb);
  return free_gb < 1 ? Problem(folder + text + "; a flight of 1000 keyframes takes about 0.3 GB") : Ok(folder + text);
}

Finding CheckTool(const std::string& program, const std::string& package, const std::string& use) {
  const std::string path = FindOnPath(program);
  if (path.empty()) return Note(program + " is missing (for " + use + "): install the package " + package);
  return Ok(path + " (for " + use + ")");
}

Finding CheckSpy() {
  try {
    SpyClassPath();
    return Ok("Java, lcm-spy, mapmend's message types and a display are there (for mapmend spy)");
  } catch (const std::exception& e) {
    return Note(e.what());
  }
}

// Prints a line, or adds to the list if there is one.
bool Examine(const std::string& name, nlohmann::ordered_json* list, const std::function<Finding()>& check) {
  Finding finding;
  try {
    finding = check();
  } catch (const std::exception& e) {
    finding = Problem(e.what());
  }
  if (list != nullptr) {
    const char* levels[] = {"ok", "note", "problem"};
    list->push_back({{"what", name}, {"level", levels[static_cast<int>(finding.level)]}, {"text", finding.text}});
  } else {
    const char* levels[] = {"ok", "note", "PROBLEM"};
    std::printf("%-8s %-11s %s\n", levels[static_cast<int>(finding.level)], name.c_str(), finding.text.c_str());
  }
  return finding.level != Finding::Level::kProblem;
}

}  // namespace

void AddDoctorCommand(CLI::App* app) {
  CLI::App* sub = app->add_subcommand("doctor", "Check what mapmend needs of this machine, a line each");
  const auto options = std::make_shared<DoctorOptions>();
  sub->add_option("--lcm-url", options->lcm_url, "LCM network to check (default: $LCM_DEFAULT_URL)");
  sub->add_option("--vocabulary", options->vocabulary, "vocabulary to check (default: mapmend's own)");
  sub->add_option("--out", options->out, "folder on the disk to check")->capture_default_str();
  sub->add_flag("--json", options->json, "a JSON list of {what, level, text} instead of lines");
  sub->footer("Exit code 1 if there is a PROBLEM; a note concerns only what it names.");
  sub->callback([options] {
    nlohmann::ordered_json findings = nlohmann::ordered_json::array();
    auto* const list = options->json ? &findings : nullptr;
    bool healthy = Examine("programs", list, CheckPrograms);
    healthy &= Examine("processor", list, CheckProcessor);
    healthy &= Examine("vocabulary", list, [&] { return CheckVocabularyFile(options->vocabulary); });
    healthy &= Examine("bus", list, [&] { return CheckBus(UrlFromOptionOrEnvironment(options->lcm_url)); });
    healthy &= Examine("multicast", list, CheckMulticast);
    healthy &= Examine("multicast", list, CheckReceiveBuffer);
    healthy &= Examine("live page", list, [] {
      return Ok("port " + std::to_string(FreePort(8080, false, "--port").Port()) + " is free");
    });
    healthy &= Examine("disk", list, [&] { return CheckDisk(options->out); });
    healthy &= Examine("recorder", list, [] { return CheckTool("lcm-logger", "liblcm-bin", "--record"); });
    healthy &= Examine("simulate", list, [] { return CheckTool("ffmpeg", "ffmpeg", "mapmend simulate"); });
    healthy &= Examine("spy", list, CheckSpy);
    if (options->json) std::printf("%s\n", findings.dump(2).c_str());
    if (!healthy) throw CLI::RuntimeError(1);
  });
}

}  // namespace mapmend
