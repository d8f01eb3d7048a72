#pragma once

#include <functional>
#include <string>
#include <vector>

#include "libs/map_view/image_source.h"
#include "libs/map_view/snapshot.h"
#include "libs/mosaic/mosaic.h"

namespace mapmend {

struct MosaicExportOptions {
  bool enabled = true;  // if there are images of keyframes, and a ground
  MosaicOptions mosaic;
  int preview_px = 1600;  // of the pictures for people, width or height
  // Only this part of the ground, in the frame of mosaic.tif: west, south, east, north; empty: all of it.
  std::vector<double> bounds;

  template <typename Visitor>
  void Visit(Visitor& v) {
    v("enabled", enabled);
    mosaic.Visit(v);
    v("preview_px", preview_px, Range(100, 100000), "pixels");
    v("bounds", bounds, Range(-1e12, 1e12), "west, south, east, north");
  }
  // Empty, or which options contradict each other.
  std::string Conflict() const {
    const bool good = bounds.empty() || (bounds.size() == 4 && bounds[0] < bounds[2] && bounds[1] < bounds[3]);
    return good ? "" : "bounds are four numbers: west, south, east, north";
  }
};

// Writes the picture of the ground of one component into a folder: mosaic.tif, surface.tif, mosaic.png, coverage.png,
// mosaic.json, and on the earth mosaic.kmz (docs/exports.md). The component is levelled first if its frame does not
// point upwards; the snapshot is a copy. What an earlier export left there is removed if there is no picture now.
//   image     of a keyframe
//   progress  may be empty; it gets the share that is done
// Returns mosaic.json as text; its member "problem" says why there is no picture. Throws std::runtime_error if a file
// cannot be written.
std::string ExportMosaic(Snapshot snapshot, int component, const FetchImage& image, const MosaicExportOptions& options,
                         const std::function<void(double)>& progress, const std::string& folder);

// What ExportMosaic writes.
const std::vector<std::string>& MosaicFiles();

// A PNG with an alpha channel as a JPEG on white, for pages.
std::string AsJpeg(const std::string& png);

}  // namespace mapmend
