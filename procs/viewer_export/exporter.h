#pragma once

#include <functional>
#include <optional>
#include <string>
#include <vector>

#include "libs/map_view/image_source.h"
#include "libs/map_view/snapshot.h"
#include "libs/map_view/world.h"
#include "procs/viewer_export/coverage.h"
#include "procs/viewer_export/map_evaluation.h"
#include "procs/viewer_export/mosaic_export.h"

namespace mapmend {

// Makes sure that dir exists and can be written to. Throws std::runtime_error with one line.
void PrepareDirectory(const std::string& dir);

struct ExportOptions {
  std::string frame = "map";                    // one of FrameNames
  std::vector<std::string> formats;             // beside those that are always written (libs/formats/map_formats.h)
  PictureSource pictures;                       // images and descriptors; may be empty
  std::optional<Geodetic> ground_truth_origin;  // of its coordinates; nullopt: the first position
  PlacementOptions placement;
  CoverageOptions coverage;
  MosaicExportOptions mosaic;
  std::function<void(double share)> progress;  // of the mosaic; may be empty
};

// Writes every export of the map into dir (docs/exports.md describes the files); summary.json and report.html come
// last. Formats written on demand that lie in dir are written anew, so that none is of an older map. Files of
// components and submaps that an earlier export left and that do not exist any more are removed. ground_truth may be
// null. One that cannot be written (a full disk) does not keep the others from being written. Returns a line for each
// that failed; empty: all are there.
std::vector<std::string> ExportAll(const MapModel& model, const GroundTruth* ground_truth, const std::string& dir,
                                   const ExportOptions& options = {});

// Makes report.html in dir again from summary.json and the pictures there.
void RebuildReport(const std::string& dir);

}  // namespace mapmend
