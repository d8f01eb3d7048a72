#pragma once

#include <string>

#include "libs/base/range.h"
#include "libs/bus/process.h"
#include "libs/mosaic/tile_mosaic.h"
#include "procs/mosaic/live_scene.h"

namespace mapmend {

struct MosaicProcessOptions {
  ProcessOptions process;
  std::string out;  // mosaic.mbtiles
  LiveSceneOptions scene;
  TileMosaicOptions tiles;
  double min_interval_s = 0.5;  // between looks at the map
  double pause_share = 8;       // times as long as a look at the map took is done something else

  // Not visited: process, out: of one run.
  template <typename Visitor>
  void Visit(Visitor& v) {
    scene.Visit(v);
    tiles.Visit(v);
    v("min_interval_s", min_interval_s, AtLeast(0), "s");
    v("pause_share", pause_share, AtLeast(0));
  }
};

// Draws the ground while it is mapped, until a signal. Returns the exit code. Throws std::runtime_error with one line
// on trouble.
int RunMosaicProcess(const MosaicProcessOptions& options);

}  // namespace mapmend
