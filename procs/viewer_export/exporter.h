#pragma once

#include <string>
#include <vector>

#include "procs/viewer_export/map_evaluation.h"
#include "procs/viewer_export/snapshot.h"

namespace mapmend {

// Makes sure that dir exists and can be written to. Throws std::runtime_error with one line.
void PrepareDirectory(const std::string& dir);

// Writes every export of the map into dir (docs/exports.md describes the files); summary.json and report.html come
// last. Files of components and submaps that an earlier export left and that do not exist any more are removed.
// ground_truth may be null. One that cannot be written (a full disk) does not keep the others from being written.
// Returns a line for each that failed; empty: all are there.
std::vector<std::string> ExportAll(const MapModel& model, const GroundTruth* ground_truth, const std::string& dir);

// Makes report.html in dir again from summary.json and the pictures there.
void RebuildReport(const std::string& dir);

}  // namespace mapmend
