#include "procs/mapmend/process_settings.h"

#include <fcntl.h>
#include <spawn.h>
#include <sys/wait.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <cstring>
#include <nlohmann/json.hpp>
#include <stdexcept>

#include "libs/base/nearest_word.h"
#include "libs/base/options.h"
#include "libs/base/options_file.h"
#include "libs/command_line/command_line.h"
#include "libs/command_line/option_flags.h"
#include "procs/mapmend/paths.h"

namespace mapmend {
namespace {

constexpr char kOwnName[] = "mapmend";

std::string FirstPart(const std::string& name) { return name.substr(0, name.find_first_of(".=")); }

std::string Listed(const std::vector<std::string>& words) {
  std::string text;
  for (const std::string& word : words) text += (text.empty() ? "" : ", ") + word;
  return text;
}

// A value of ChangesToJson as --set takes it.
std::string SettingText(const nlohmann::json& value) {
  if (value.is_string()) return value.get<std::string>();
  if (value.is_null()) return "none";
  const std::string text = value.dump();
  return value.is_array() ? text.substr(1, text.size() - 2) : text;
}

std::string ReadAll(int fd) {
  std::string text;
  char buffer[4096];
  for (;;) {
    const ssize_t count = read(fd, buffer, sizeof(buffer));
    if (count < 0 && errno == EINTR) continue;
    if (count <= 0) return text;
    text.append(buffer, static_cast<size_t>(count));
  }
}

struct Ended {
  int status = 0;  // of waitpid
  std::string output, errors;
};

// Runs a program to its end. What it prints must be short enough for a pipe on one of the two.
Ended Run(std::vector<std::string> words) {
  int output[2], errors[2];
  if (pipe2(output, O_CLOEXEC) != 0) throw std::runtime_error("cannot make a pipe");
  if (pipe2(errors, O_CLOEXEC) != 0) {
    close(output[0]), close(output[1]);
    throw std::runtime_error("cannot make a pipe");
  }
  posix_spawn_file_actions_t actions;
  posix_spawn_file_actions_init(&actions);
  posix_spawn_file_actions_adddup2(&actions, output[1], STDOUT_FILENO);
  posix_spawn_file_actions_adddup2(&actions, errors[1], STDERR_FILENO);
  std::vector<char*> argv;
  for (std::string& word : words) argv.push_back(word.data());
  argv.push_back(nullptr);
  pid_t pid = 0;
  const int error = posix_spawn(&pid, words.front().c_str(), &actions, nullptr, argv.data(), environ);
  posix_spawn_file_actions_destroy(&actions);
  close(output[1]), close(errors[1]);
  Ended ended;
  ended.output = ReadAll(output[0]);
  ended.errors = ReadAll(errors[0]);  // a line
  close(output[0]), close(errors[0]);
  if (error != 0) throw std::runtime_error("cannot start " + words.front() + ": " + std::strerror(error));
  while (waitpid(pid, &ended.status, 0) < 0 && errno == EINTR) {
  }
  return ended;
}

}  // namespace

std::string AskProgram(const std::string& program, const std::vector<std::string>& arguments) {
  std::vector<std::string> words = {FindProgram(program)};
  words.insert(words.end(), arguments.begin(), arguments.end());
  Ended ended = Run(words);
  if (WIFEXITED(ended.status) && WEXITSTATUS(ended.status) == 0) return ended.output;
  std::string line = ended.errors.substr(0, ended.errors.find('\n'));
  if (WIFEXITED(ended.status) && WEXITSTATUS(ended.status) == kExitUsage) {
    for (const std::string& prefix : {ErrorPrefix(program), std::string("mapmend: ")}) {
      if (line.starts_with(prefix)) line.erase(0, prefix.size());
    }
    throw UsageError(line);
  }
  throw std::runtime_error(program + " does not tell its options" + (line.empty() ? "" : ": " + line));
}

void ProcessSettings::AddFlags(CLI::App* sub, const std::vector<std::string>& processes) {
  processes_ = processes;
  processes_.emplace_back(kOwnName);
  const bool flies = std::find(processes.begin(), processes.end(), "frontend") != processes.end();
  AddSettingFlags(
      sub, flies ? "frontend.tracker.min_inliers=30" : "merger.search.max_proposals=30", "`mapmend options`",
      [this](const std::string& path) {
        given_.push_back({true, path});
      },
      [this](const std::string& setting) {
        given_.push_back({false, setting});
      });
}

void ProcessSettings::CheckFile(const std::string& path) {
  try {
    for (const OptionLine& line : ReadOptionsFile(path)) {
      if (!IsUnderAnyProgram(line.name)) {
        throw OptionError(PlaceOf(path, line) + line.name + ": options stand under the name of their process (" +
                          Listed(processes_) + ")");
      }
      concerned_.push_back(FirstPart(line.name));
    }
  } catch (const OptionError& e) {
    throw UsageError(std::string("--config ") + e.what());
  }
}

void ProcessSettings::CheckSetting(const std::string& setting) {
  const std::string process = FirstPart(setting);
  if (std::find(processes_.begin(), processes_.end(), process) == processes_.end()) {
    const std::string meant = NearestWord(process, processes_);
    throw UsageError("--set " + setting + ": begins with no process of this command (" + Listed(processes_) + ")" +
                     (meant.empty() ? "" : "; did you mean " + meant + "?"));
  }
  concerned_.push_back(process);
}

void ProcessSettings::Ask(const std::string& process) {
  std::vector<std::string> arguments;
  for (const Given& given : given_) {
    if (!given.is_file && FirstPart(given.text) != process) continue;
    if (process != kOwnName) {
      arguments.insert(arguments.end(), {given.is_file ? "--config" : "--set", given.text});
    } else if (given.is_file) {
      ApplyOptionsFile(given.text, process, OptionList::Of(launcher_));
    } else {
      ApplySetting(given.text, process, OptionList::Of(launcher_));
    }
  }
  if (process == kOwnName) return RequireGoodOptions(OptionList::Of(launcher_));
  arguments.emplace_back("--print-changes");
  const std::string changes = AskProgram(process, arguments);
  const nlohmann::json parsed = nlohmann::json::parse(changes, nullptr, false);
  if (!parsed.is_object()) throw std::runtime_error(process + " does not tell its options");
  if (!parsed.empty()) changes_[process] = parsed.dump();
}

void ProcessSettings::Resolve() {
  for (const Given& given : given_) given.is_file ? CheckFile(given.text) : CheckSetting(given.text);
  for (const std::string& process : processes_) {
    if (std::find(concerned_.begin(), concerned_.end(), process) != concerned_.end()) Ask(process);
  }
}

std::vector<std::string> ProcessSettings::Arguments(const std::string& process) const {
  std::vector<std::string> arguments;
  const auto found = changes_.find(process);
  if (found == changes_.end()) return arguments;
  const nlohmann::json changes = nlohmann::json::parse(found->second);
  for (const auto& [name, value] : changes.items())
    arguments.insert(arguments.end(), {"--set", name + "=" + SettingText(value)});
  return arguments;
}

std::string ProcessSettings::Changes(const std::string& process) const {
  const auto found = changes_.find(process);
  return found == changes_.end() ? "" : found->second;
}

}  // namespace mapmend
