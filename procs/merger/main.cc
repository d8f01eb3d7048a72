#include <CLI/CLI.hpp>

#include "libs/command_line/command_line.h"
#include "libs/command_line/option_flags.h"
#include "procs/merger/merger_process.h"

namespace {

int Run(int argc, char** argv) {
  CLI::App app("Connects the submaps of all sessions on the bus, places them in one frame, and refines the merged map",
               "merger");
  mapmend::MergerProcessOptions options;
  mapmend::AddProcessOptions(&app, &options.process);
  app.add_option("--vocabulary", options.vocabulary, "vocabulary file; sessions made with another one are refused");
  app.add_option("--seed", options.merger.seed, "seed of every random choice (default: that of the flight)");
  app.add_option("--cache-keyframes", options.merger.search.max_cached_keyframes,
                 "keyframes held complete in memory; the bulk of the others is read from the store when needed")
      ->check(CLI::PositiveNumber)
      ->capture_default_str();
  mapmend::AddOptionFlags(&app, "merger", &options.merger);
  if (const auto code = mapmend::ParseCommandLine(&app, argc, argv)) return *code;
  mapmend::RequireGoodOptions(mapmend::OptionList::Of(options.merger));
  mapmend::ApplyLogLevel(options.process);
  return mapmend::RunMergerProcess(options);
}

}  // namespace

int main(int argc, char** argv) { return mapmend::RunMain("merger", Run, argc, argv); }
