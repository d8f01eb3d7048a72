#pragma once

#include <map>
#include <string>
#include <utility>
#include <vector>

namespace mapmend {

// report.html: one page that stands alone (inline SVG and CSS, no script), written for the operator of a UAV: is the
// map whole, where did it break, and why were two submaps joined or not?
//   summary_json     text of summary.json; keys that the launcher adds (wall_s, frontend, processes) are shown if there
//   graph_svg        text of graph.svg
//   edge_pictures    JPEG of connections, by the numbers of their two submaps
//   trajectory_svgs  text of trajectory.svg, then of components/1/trajectory.svg, ...
//   gaps_svg         text of gaps.svg; empty: there is none
// Throws std::runtime_error with one line if the summary is not readable as one.
std::string MakeReport(const std::string& summary_json, const std::string& graph_svg,
                       const std::vector<std::string>& trajectory_svgs,
                       const std::map<std::pair<int, int>, std::string>& edge_pictures = {},
                       const std::string& gaps_svg = "");

}  // namespace mapmend
