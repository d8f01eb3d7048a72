#include "procs/viewer_export/report_world.h"

#include <algorithm>
#include <cctype>
#include <cmath>
#include <string>

#include "libs/base/text_format.h"
#include "libs/drawing/svg_canvas.h"

namespace mapmend {
namespace {

using Json = nlohmann::json;

std::string Text(const Json& value) { return EscapeXml(value.get<std::string>()); }

std::string PartName(size_t component, size_t count) {
  return component > 0 ? "part " + std::to_string(component) : count == 1 ? "the map" : "main map";
}

std::string Clocks(const Json& world) {
  std::string html;
  for (const Json& clock : world.value("clocks", Json::array())) {
    const double offset = clock.value("offset_s", 0.0);
    if (offset == 0) continue;
    html += "<p>The clock of the camera is " +
            Format("%.2f s %s", std::abs(offset), offset > 0 ? "ahead of" : "behind") +
            " that of the receiver (found from the flight itself, and taken out).</p>\n";
  }
  return html;
}

std::string Row(const Json& component, size_t index, size_t count) {
  std::string html = "<tr><td class=\"left\">" + PartName(index, count) + "</td>";
  if (!component.value("placed", false))
    return html + "<td colspan=\"7\" class=\"left\">not placed: " + Text(component["problem"]) + "</td></tr>\n";
  html += "<td>" + std::to_string(component["positions"].get<int64_t>()) + "</td>";
  html += "<td>" + Format("%.2f m", component["horizontal_residual_median_m"].get<double>()) + "</td>";
  html += "<td>" + Format("%.2f m", component["vertical_residual_median_m"].get<double>()) + "</td>";
  html += "<td>" + std::to_string(component["outliers"].get<int64_t>()) + "</td>";
  html += "<td>" +
          Format("± %.2f m, ± %.2f°", component["sigma_horizontal_m"].get<double>(),
                 component["sigma_heading_deg"].get<double>()) +
          "</td>";
  const bool has_truth = component.contains("groundtruth");
  html +=
      "<td>" +
      (has_truth ? Format("%.2f m", component["groundtruth"]["horizontal_rmse_m"].get<double>()) : std::string("–")) +
      "</td>";
  return html + "<td class=\"text\">" + (component.contains("problem") ? Text(component["problem"]) : "") +
         "</td></tr>\n";
}

}  // namespace

std::string WorldSection(const Json& s) {
  if (!s.contains("world")) return "";
  const Json& world = s["world"];
  std::string html = "<h2>Where on the earth</h2>\n";
  if (world.contains("problem")) return html + "<p>Not placed: " + Text(world["problem"]) + ".</p>\n";
  const Json& origin = world["origin"];
  html += "<p>" + std::to_string(world["positions"].get<int64_t>()) + " positions; east, north and up count from " +
          Format("%.7f, %.7f, %.1f m", origin["latitude_deg"].get<double>(), origin["longitude_deg"].get<double>(),
                 origin["altitude_m"].get<double>()) +
          " (the first of them), " + Text(world["utm"]["name"]) +
          ". Files: path.geojson, map.kml, positions.csv.</p>\n" + Clocks(world);
  html +=
      "<div class=\"scroll\"><table>\n<tr><th class=\"left\">Part</th><th>Positions</th><th>Beside them, "
      "horizontally</th><th>vertically</th><th>Outliers</th><th>Known to</th><th>From the ground truth, not "
      "aligned</th><th class=\"text\">Open</th></tr>\n";
  const Json& components = world["components"];
  for (size_t c = 0; c < components.size(); ++c) html += Row(components[c], c, components.size());
  html += "</table></div>\n";
  if (components.size() > 1)
    html += "<p>The parts lie in one world by their positions alone; nothing that was seen joins them.</p>\n";
  return html;
}

std::string GapSection(const Json& s, const std::string& gaps_svg) {
  if (!s.contains("gaps")) return "";
  const Json& gaps = s["gaps"];
  std::string html = "<h2>What to fly again</h2>\n";
  if (!gaps_svg.empty()) html += "<div class=\"picture\">" + gaps_svg + "</div>\n";
  if (gaps.contains("problem")) html += "<p>" + Text(gaps["problem"]) + ".</p>\n";
  if (gaps["list"].empty())
    return html + "<p>Nothing: every part of the flight is in the map, and no hole is in it.</p>\n";
  html += "<ul class=\"why\">\n";
  constexpr size_t kMost = 30;
  for (size_t i = 0; i < std::min(kMost, gaps["list"].size()); ++i) {
    std::string text = Text(gaps["list"][i]["text"]);
    text[0] = static_cast<char>(std::toupper(static_cast<unsigned char>(text[0])));
    html += "<li>" + text + ".</li>\n";
  }
  html += "</ul>\n";
  if (gaps["list"].size() > kMost)
    html += "<p>And " + std::to_string(gaps["list"].size() - kMost) + " smaller ones.</p>\n";
  if (s.contains("world") && !s["world"].contains("problem"))
    html +=
        "<p>For maps: gaps.geojson, gaps.kml. To fly it: gaps.plan (QGroundControl), gaps.waypoints (MAVLink). Look "
        "at the plan before you fly it: mapmend knows neither obstacles nor rules.</p>\n";
  return html;
}

}  // namespace mapmend
