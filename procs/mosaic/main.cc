// mosaic: draws the ground while it is mapped, as a pyramid of tiles in an MBTiles file.

#include <CLI/CLI.hpp>

#include "libs/command_line/command_line.h"
#include "libs/command_line/option_flags.h"
#include "procs/mosaic/mosaic_process.h"

namespace {

int Run(int argc, char** argv) {
  CLI::App app("Draws the ground while it is mapped: tiles for maps in browsers and GIS", "mosaic");
  mapmend::MosaicProcessOptions options;
  mapmend::AddProcessOptions(&app, &options.process);
  app.add_option("--out", options.out, "file of tiles (MBTiles), which is gone on with if it is there");
  mapmend::AddOptionFlags(&app, "mosaic", &options);
  if (const auto code = mapmend::ParseCommandLine(&app, argc, argv)) return *code;
  mapmend::RequireGoodOptions(mapmend::OptionList::Of(options));
  mapmend::ApplyLogLevel(options.process);
  return mapmend::RunMosaicProcess(options);
}

}  // namespace

int main(int argc, char** argv) { return mapmend::RunMain("mosaic", Run, argc, argv); }
