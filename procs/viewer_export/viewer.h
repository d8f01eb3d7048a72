#pragma once

#include <memory>
#include <optional>
#include <string>

#include "procs/viewer_export/exporter.h"
#include "procs/viewer_export/live_page.h"

namespace mapmend {

class Bus;

struct ViewerOptions {
  std::string out;                          // directory of the exports, see PrepareDirectory; empty: none are written
  std::optional<GroundTruth> ground_truth;  // to compare the map with
  EvaluationOptions evaluation;             // how
  PageOptions page;
  ExportOptions exports;  // into out

  // Not visited: out, ground_truth, page, exports: of one run, but for what stands below.
  template <typename Visitor>
  void Visit(Visitor& v) {
    v("evaluation", evaluation);
    v("placement", exports.placement);
    v("coverage", exports.coverage);
    v("mosaic", exports.mosaic);
  }
};

// The adapter between the bus and the map model: follows the stream and the merger, writes the exports when the final
// merged map is there, and keeps the live page up to date.
class Viewer {
 public:
  // The bus must outlive the viewer. page: null for no live page.
  Viewer(const ViewerOptions& options, std::unique_ptr<LivePage> page, Bus* bus);
  ~Viewer();

  // Runs until StopRequested().
  void Run();

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

}  // namespace mapmend
