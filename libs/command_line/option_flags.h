#pragma once

#include <functional>
#include <string>
#include <vector>

#include "libs/base/options.h"

namespace CLI {
class App;
}  // namespace CLI

namespace mapmend {

// Programs whose options can be set. One file of options may serve them all: each program takes what stands under its
// own name, or under no program's, and passes over the others'.
inline constexpr const char* kConfigurablePrograms[] = {"frontend", "hub",          "mapmend",      "merger",
                                                        "mosaic",   "submap_store", "viewer_export"};

// Whether a name begins with one of them, as "merger.search.max_proposals" does; a program's own name is one, too.
bool IsUnderProgram(const std::string& name, const std::string& program);
bool IsUnderAnyProgram(const std::string& name);

// Each throws UsageError in one line that begins with --config or --set and names the option, and the line of a file.
//   program  whose options these are
//   setting  "NAME=VALUE"
void ApplyOptionsFile(const std::string& path, const std::string& program, const OptionList& options);
void ApplySetting(const std::string& setting, const std::string& program, const OptionList& options);

// Adds --config FILE and --set NAME=VALUE to a command. They are told while the command line is read, in their order
// there, so that other flags that set the same options win wherever they stand.
//   example  for the help, "tracker.min_inliers=30"
//   lister   what lists all options
void AddSettingFlags(CLI::App* app, const std::string& example, const std::string& lister,
                     std::function<void(const std::string& path)> on_file,
                     std::function<void(const std::string& setting)> on_setting);

// The same for a program with options of its own, and --print-config. Call last, after all other options of app were
// added, and RequireGoodOptions after the command line was read.
//   program   one of kConfigurablePrograms
//   options   of the program's structs, which are changed
//   defaults  of the same structs as they are made
void AddOptionFlags(CLI::App* app, const std::string& program, const OptionList& options, const OptionList& defaults);

// The same for a program whose options are one struct.
template <typename Struct>
void AddOptionFlags(CLI::App* app, const std::string& program, Struct* options) {
  static Struct defaults;
  AddOptionFlags(app, program, OptionList::Of(*options), OptionList::Of(defaults));
}

// Throws UsageError with the first problem of the options.
void RequireGoodOptions(const OptionList& options);

}  // namespace mapmend
