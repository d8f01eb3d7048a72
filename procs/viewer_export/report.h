#pragma once

#include <map>
#include <string>
#include <utility>
#include <vector>

namespace mapmend {

// What lies beside summary.json.
struct ReportPictures {
  std::string graph_svg;
  std::vector<std::string> trajectory_svgs;                  // of the components, the main one first
  std::map<std::pair<int, int>, std::string> edge_pictures;  // JPEG, by the numbers of the two submaps
  std::string gaps_svg;                                      // empty: there is none
  std::string mosaic_jpeg, coverage_png;                     // of the main component; empty: there is none
};

// report.html: one page that stands alone (inline SVG and CSS, no script), written for the operator of a UAV: is the
// map whole, where did it break, and why were two submaps joined or not?
//   summary_json     text of summary.json; keys that the launcher adds (wall_s, frontend, processes) are shown if there
// Throws std::runtime_error with one line if the summary is not readable as one.
std::string MakeReport(const std::string& summary_json, const ReportPictures& pictures);

}  // namespace mapmend
