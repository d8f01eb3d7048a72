#include "procs/viewer_export/report.h"

#include <web/report_style.h>

#include <algorithm>
#include <cctype>
#include <cstdint>
#include <cstdio>
#include <ctime>
#include <nlohmann/json.hpp>
#include <stdexcept>
#include <string>
#include <vector>

#include "libs/drawing/canvas.h"
#include "libs/drawing/svg_canvas.h"
#include "procs/viewer_export/report_world.h"

namespace mapmend {
namespace {

using Json = nlohmann::json;

std::string Escaped(const Json& value) { return EscapeXml(value.get<std::string>()); }
std::string Int(const Json& value) { return std::to_string(value.get<int64_t>()); }

std::string Fixed(double value, int decimals) {
  char text[64];
  std::snprintf(text, sizeof(text), "%.*f", decimals, value);
  return text;
}

std::string Percent(double part, double whole) { return whole > 0 ? Fixed(100 * part / whole, 1) + " %" : "–"; }

std::string Plural(int64_t n, const std::string& word) { return std::to_string(n) + " " + word + (n == 1 ? "" : "s"); }

std::string Readable(std::string text) {
  std::replace(text.begin(), text.end(), '_', ' ');
  return text;
}

// "2018-04-29 12:06 UTC"; empty for times that are no date.
std::string Date(int64_t utime) {
  const std::time_t seconds = utime / 1000000;
  std::tm tm{};
  if (seconds < 315532800 || gmtime_r(&seconds, &tm) == nullptr) return "";  // 1980
  char text[64];
  std::strftime(text, sizeof(text), "%Y-%m-%d %H:%M UTC", &tm);
  return text;
}

std::string Chip(int64_t submap) {
  const std::string color = CategoryColor(static_cast<int>(submap));
  return "<span class=\"chip\" style=\"background:" + color + ";color:" + InkOn(color) + "\">" +
         std::to_string(submap) + "</span>";
}

std::string Sentence(std::string text) {
  if (!text.empty()) text[0] = static_cast<char>(std::toupper(static_cast<unsigned char>(text[0])));
  return text + (text.ends_with(".") ? "" : ".");
}

// On narrow screens a row of a table becomes a list: each cell carries the heading of its column.
std::string WithLabels(const std::string& html) {
  std::string labelled;
  std::vector<std::string> headings;
  size_t column = 0;
  for (size_t at = 0; at < html.size();) {
    const size_t tag = html.find("<t", at);
    if (tag == std::string::npos) return labelled + html.substr(at);
    labelled += html.substr(at, tag - at);
    const size_t end = html.find('>', tag);
    std::string opening = html.substr(tag, end - tag);
    if (opening.starts_with("<table")) headings.clear();
    if (opening.starts_with("<tr")) column = 0;
    if (opening.starts_with("<th")) headings.push_back(html.substr(end + 1, html.find("</th>", end) - end - 1));
    if (opening.starts_with("<td") && column < headings.size()) opening += " data-label=\"" + headings[column++] + "\"";
    labelled += opening;
    at = end;
  }
  return labelled;
}

std::string PartName(const Json& summary, int64_t component) {
  if (component == 0) return summary["components"].size() == 1 ? "the map" : "main map";
  return "part " + std::to_string(component);
}

std::string Banner(const Json& s) {
  const size_t parts = s["components"].size();
  const int64_t in = s["frames_in"], tracked = s["frames_tracked"], main = s["frames_in_main"], losses = s["losses"];
  std::string level = "good", head, text;
  if (parts == 0 || tracked == 0) {
    level = "bad";
    head = "There is no map";
    text = "Tracking never started.";
  } else if (parts == 1) {
    head = "The map is in one piece";
    text = losses == 0 ? "Tracking was never lost."
                       : "Tracking was lost " + std::string(losses == 1 ? "once" : std::to_string(losses) + " times") +
                             (s["submaps"].size() == 2 ? "; both" : "; all " + std::to_string(s["submaps"].size())) +
                             " submaps are joined in one map.";
    if (const std::string holes = s.value("holes_in_words", ""); !holes.empty()) text += " It has " + holes + ".";
  } else {
    level = "warn";
    head = "The map is in " + std::to_string(parts) + " parts";
    text = "The main map holds " + Percent(static_cast<double>(main), static_cast<double>(tracked)) +
           " of the tracked frames. Below stands why the parts could not be joined.";
  }
  if (in > tracked && tracked > 0)
    text += " " + Plural(in - tracked, "frame") + " of " + std::to_string(in) + " could not be tracked.";
  if (s.contains("problem")) {
    level = "bad";
    text += " " + Sentence(s["problem"]);
  }
  if (!s["final"].get<bool>()) text += " This is not the final map: the merger has not finished.";
  return "<div class=\"banner " + level + "\"><b>" + head + "</b><span>" + EscapeXml(text) + "</span></div>\n";
}

std::string Figure(const std::string& value, const std::string& label, const std::string& note) {
  return "<div class=\"figure\"><b>" + value + "</b><span>" + label + "</span><i>" + note + "</i></div>\n";
}

std::string Figures(const Json& s) {
  const double in = s["frames_in"], tracked = s["frames_tracked"], main = s["frames_in_main"];
  std::string html = "<div class=\"figures\">\n";
  html +=
      Figure(Percent(main, in), "of all frames in the map", Int(s["frames_in_main"]) + " of " + Int(s["frames_in"]));
  html +=
      Figure(Percent(tracked, in), "of all frames tracked", Int(s["frames_tracked"]) + " of " + Int(s["frames_in"]));
  const Json frontend = s.value("frontend", Json::object());
  if (const int64_t dropped = frontend.value("frames_dropped", int64_t{0}); dropped > 0) {
    html += Figure(std::to_string(dropped), "frames dropped", "came while the frontend was busy");
  }
  html += Figure(std::to_string(s["submaps"].size()), "submaps",
                 Int(s["losses"]) + (s["losses"] == 1 ? " loss" : " losses") + " of tracking");
  html += Figure(Int(s["keyframes_in_main"]), "keyframes in the map", "of " + Int(s["keyframes_total"]));
  html += Figure(Int(s["points_in_main"]), "points in the map", "");
  if (s.contains("ate_rmse_m")) {
    html += Figure(Fixed(s["ate_rmse_m"], 3) + " m", "error (ATE RMSE)",
                   "median " + Fixed(s["ate_median_m"], 3) + ", max " + Fixed(s["ate_max_m"], 3) + " m");
  }
  if (s.contains("readout_ms")) {
    html += Figure(Fixed(s["readout_ms"], 1) + " ms", "rolling shutter",
                   "first to last " + std::string(s.value("readout_by", "rows") == "columns" ? "column" : "row") +
                       " of an image; corrected");
  }
  if (s.contains("wall_s")) html += Figure(Fixed(s["wall_s"], 1) + " s", "wall time", "");
  if (s.contains("frontend") && s["frontend"].contains("track_ms_median")) {
    html += Figure(
        Fixed(s["frontend"]["track_ms_median"], 1) + " ms", "tracking per frame",
        s["frontend"].contains("track_ms_p95") ? "95 % below " + Fixed(s["frontend"]["track_ms_p95"], 1) + " ms" : "");
  }
  return html + "</div>\n";
}

// Why there is no error in the figures although there is a ground truth.
std::string GroundTruthProblem(const Json& s) {
  if (!s.contains("groundtruth_problem")) return "";
  return "<p><b>No accuracy:</b> " + Escaped(s["groundtruth_problem"]) + "</p>\n";
}

// For each part beside the main map: the strongest attempt to join it to another part, or that there was none.
std::string WhyApart(const Json& s) {
  if (s["components"].size() < 2) return "";
  const auto component = [&](const Json& submap_id) -> int64_t {
    for (const Json& submap : s["submaps"]) {
      if (submap["id"] == submap_id) return submap["component"];
    }
    return -1;
  };
  std::string html = "<h2>Why the map is not in one piece</h2>\n<ul class=\"why\">\n";
  for (size_t c = 1; c < s["components"].size(); ++c) {
    const Json& part = s["components"][c];
    const Json* best = nullptr;
    int64_t attempts = 0;
    for (const Json& connection : s["connections"]) {
      const bool a = component(connection["a"]) == static_cast<int64_t>(c),
                 b = component(connection["b"]) == static_cast<int64_t>(c);
      if (a == b) continue;
      ++attempts;
      const auto rank = [](const Json& x) {
        return std::make_pair(x["C"].get<double>(), x["candidates"].get<int64_t>());
      };
      if (best == nullptr || rank(connection) > rank(*best)) best = &connection;
    }
    html += "<li><b>Part " + std::to_string(c) + "</b> (";
    for (const Json& submap : part["submaps"]) html += Chip(submap) + " ";
    html += Plural(part["frames"], "frame") + "): ";
    if (best == nullptr) {
      html += "nothing that was seen here was recognised anywhere else, so no connection was tried.";
    } else {
      html += Plural(attempts, "connection") + " to other parts " + (attempts == 1 ? "was" : "were") +
              " tried, none held. The most promising, " + Chip((*best)["a"]) + "–" + Chip((*best)["b"]) + ": " +
              Escaped((*best)["reason"]);
    }
    html += "</li>\n";
  }
  return html + "</ul>\n";
}

// Who saw a submap, by the name of the vehicle; by what it flew if it has none.
std::string FlightName(const Json& s, const Json& submap) {
  const Json& session = s["sessions"].at(submap["session"].get<size_t>());
  return Escaped(session["vehicle"].get<std::string>().empty() ? session["source"] : session["vehicle"]);
}

std::string SubmapTable(const Json& s) {
  const bool errors = s.contains("groundtruth"), flights = s["sessions"].size() > 1;
  std::string html = "<h2>Submaps</h2>\n<div class=\"scroll\"><table>\n<tr><th>Submap</th>" +
                     std::string(flights ? "<th class=\"left\">Seen by</th>" : "") +
                     "<th class=\"left\">Belongs to</th><th>First frame</th><th>Last frame</th>"
                     "<th>Frames</th><th>Keyframes</th><th>Points</th><th>Scale in the map</th>" +
                     std::string(errors ? "<th>Error RMSE</th><th>Error max</th><th>Max of depth</th>" : "") +
                     "<th class=\"text\">Ended because</th></tr>\n";
  for (const Json& m : s["submaps"]) {
    html += "<tr><td>" + Chip(m["id"]) + " " + Escaped(m["letters"]) + "</td>" +
            (flights ? "<td class=\"left\">" + FlightName(s, m) + "</td>" : "") + "<td class=\"left\">" +
            PartName(s, m["component"]) + (m["is_root"].get<bool>() ? " (root)" : "") + "</td>";
    const bool any = m["frames"].get<int64_t>() > 0;
    html += "<td>" + (any ? Int(m["first_frame"]) : "–") + "</td><td>" + (any ? Int(m["last_frame"]) : "–") + "</td>";
    for (const char* key : {"frames", "keyframes", "points"}) html += "<td>" + Int(m[key]) + "</td>";
    html += "<td>" + Fixed(m["root_from_submap"][7], 3) + "</td>";
    if (errors) {
      for (const char* key : {"ate_rmse_m", "ate_max_m"}) {
        html += "<td>" + (m.contains(key) ? Fixed(m[key], 3) + " m" : std::string("–")) + "</td>";
      }
      html += "<td>" + (m.contains("max_error_of_depth") ? Percent(m["max_error_of_depth"], 1) : std::string("–")) +
              "</td>";
    }
    const std::string reason = m["end_reason"], detail = m["end_detail"];
    const std::string words = reason.empty() ? "still growing" : EscapeXml(Readable(reason));
    html +=
        "<td class=\"text\">" + words + (detail.empty() ? "" : "<br><i>" + EscapeXml(detail) + "</i>") + "</td></tr>\n";
  }
  html += "</table></div>\n";
  if (errors) {
    html +=
        "<p class=\"note\">The errors are of each submap as it was tracked, aligned to the ground truth by itself "
        "(rotation, translation and scale). <b>Max of depth</b>: the largest error of a frame as a share of the "
        "distance to the "
        "scene there.</p>\n";
  }
  return html;
}

std::string RestorationEvent(const Json& s, const Json& step) {
  const auto name = [&](const Json& number) {
    for (const Json& submap : s["submaps"]) {
      if (submap["id"] == number) return Escaped(submap["letters"]);
    }
    return Int(number);
  };
  const std::string submap = name(step["submap"]);
  if (step["event"] == "new_map") {
    if (!step.contains("lost")) return "the map " + submap + " is begun";
    return name(step["lost"]) + " is lost (" + EscapeXml(Readable(step["loss_reason"])) + "), " + submap + " is begun";
  }
  std::string text;
  for (const Json& c : step["connections"]) {
    text += (text.empty() ? "" : "; ") + name(c["a"]) + "–" + name(c["b"]) + ": F " + Int(c["F"]) + ", M " +
            Int(c["M"]) + ", θ " + Fixed(c["theta_deg"], 1) + "°, C " + Fixed(c["C"], 1);
  }
  return submap + " is connected: " + text;
}

// The merging process, as in Table 1 of the paper.
std::string RestorationRows(const Json& s) {
  if (!s.contains("restoration") || s["restoration"].size() < 2) return "";
  const int64_t start = s["restoration"][0]["utime"];
  std::string html =
      "<h2>How the map was restored</h2>\n<div class=\"scroll\"><table>\n<tr><th>Time</th><th>Frame</th>"
      "<th class=\"text\">What happened</th><th class=\"text\">Not recovered (L1)</th>"
      "<th class=\"text\">Map being tracked (L2)</th></tr>\n";
  for (const Json& step : s["restoration"]) {
    const int64_t frame = step["frame"];
    html += "<tr><td>" + Fixed(1e-6 * static_cast<double>(step["utime"].get<int64_t>() - start), 1) + " s</td><td>" +
            (frame < 0 ? "–" : std::to_string(frame)) + "</td><td class=\"text\">" + RestorationEvent(s, step) +
            "</td><td class=\"text\">" + Escaped(step["L1_letters"]) + "</td><td class=\"text\">" +
            Escaped(step["L2_letters"]) + "</td></tr>\n";
  }
  return html +
         "</table></div>\n<p class=\"note\">Submaps are named A, B, C … in the order of time. <b>L1</b>: maps that "
         "tracking has left and that are not connected with the present one yet. <b>L2</b>: the submaps of the map in "
         "which the camera is tracked. A merge stands at the first frame that sees the ground of a lost map and whose "
         "connection held in the end.</p>\n";
}

std::string ConnectionTable(const Json& s) {
  std::string html = "<h2>Connections</h2>\n";
  if (s["connections"].empty()) {
    return html + "<p class=\"note\">No pair of submaps was compared: " +
           (s["submaps"].size() < 2 ? "there is only one." : "retrieval found no place seen in two of them.") +
           "</p>\n";
  }
  std::vector<const Json*> rows;
  for (const Json& connection : s["connections"]) rows.push_back(&connection);
  const auto rank = [](const Json* c) {
    return std::make_tuple(!(*c)["in_tree"].get<bool>(), (*c)["verdict"] != "accepted", -(*c)["C"].get<double>());
  };
  std::stable_sort(rows.begin(), rows.end(), [&](const Json* p, const Json* q) { return rank(p) < rank(q); });
  html +=
      "<div class=\"scroll\"><table>\n<tr><th>Submaps</th><th "
      "class=\"text\">Verdict</th><th>F</th><th>M</th><th>θ</th><th>C</th>"
      "<th>Inliers</th><th>Candidates</th><th>Error</th><th>Scale</th><th class=\"text\">Reason</th></tr>\n";
  for (const Json* row : rows) {
    const Json& c = *row;
    const bool tree = c["in_tree"].get<bool>();
    const std::string verdict = c["verdict"];
    const bool measured = c["inliers"].get<int64_t>() > 0;
    html += "<tr><td>" + Chip(c["a"]) + "–" + Chip(c["b"]) + "</td><td class=\"text\"><span class=\"verdict " +
            EscapeXml(tree ? "tree" : verdict) + "\">" + EscapeXml(tree ? "joined, in the tree" : verdict) +
            (c.value("weak", false) ? ", weak" : "") + "</span></td>";
    html += "<td>" + Int(c["F"]) + "</td><td>" + Int(c["M"]) + "</td><td>" + Fixed(c["theta_deg"], 1) + "°</td><td>" +
            Fixed(c["C"], 1) + "</td><td>" + Int(c["inliers"]) + "</td><td>" + Int(c["candidates"]) + "</td><td>" +
            (measured ? Fixed(c["reprojection_error_px"], 2) + " px" : "–") + "</td><td>" +
            (measured ? Fixed(c["scale"], 3) : "–") + "</td><td class=\"text\">" + Escaped(c["reason"]) +
            "</td></tr>\n";
  }
  html += "</table></div>\n";
  html +=
      "<p class=\"note\"><b>F</b> connected frames: pairs of keyframes, one of each submap, that see the same place "
      "and passed the "
      "geometric check. <b>M</b> map points common to them. <b>θ</b> median angle between their rays to those points, "
      "at most 45°. "
      "<b>C</b> = F + 0.1 M + 0.1 θ², the strength of the connection; the tree takes the strongest connections that "
      "close no loop. "
      "<b>Weak</b>: used, but what it leaves open moves the far end of a submap by more than 2 % of its extent; fly "
      "over the place again if the map has to be exact beyond it. "
      "<b>Candidates</b> pairs of keyframes that looked alike. <b>Error</b> median reprojection error. <b>Scale</b> of "
      "the second "
      "submap's units against the first's.</p>\n";
  return html;
}

std::string Base64(const std::string& bytes) {
  static const char kDigits[] = "ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789+/";
  std::string text;
  for (size_t i = 0; i < bytes.size(); i += 3) {
    uint32_t group = 0;
    for (size_t k = 0; k < 3; ++k) group = group << 8 | (i + k < bytes.size() ? static_cast<uint8_t>(bytes[i + k]) : 0);
    for (size_t k = 0; k < 4; ++k) text += i + k > bytes.size() ? '=' : kDigits[group >> (18 - 6 * k) & 63];
  }
  return text;
}

std::string Image(const std::string& type, const std::string& bytes, const std::string& meaning) {
  return "<img alt=\"" + EscapeXml(meaning) + "\" src=\"data:image/" + type + ";base64," + Base64(bytes) + "\">";
}

// The ground from above, and how many images show each place.
std::string MosaicSection(const Json& s, const ReportPictures& pictures) {
  if (!s.contains("mosaic") || pictures.mosaic_jpeg.empty()) return "";
  const Json& mosaic = s["mosaic"];
  const bool has_metres = mosaic.value("unit", "") == "m";
  const double area = mosaic.value("area", 0.0), thin = mosaic.value("area_of_fewer_than_3_images", 0.0);
  std::string text = "Of " + Plural(mosaic.value("images", 0), "image") + ". ";
  if (has_metres)
    text += Fixed(area, 0) + " m², a pixel of mosaic.tif is " + Fixed(100 * mosaic.value("gsd", 0.0), 1) + " cm. ";
  text += Percent(area - thin, area) + " of the ground is seen by three images or more.";
  std::string html = "<figure class=\"mosaic\">" + Image("jpeg", pictures.mosaic_jpeg, "the ground from above") +
                     "<figcaption>" + text + "</figcaption></figure>\n";
  if (!pictures.coverage_png.empty()) {
    html += "<details open><summary>How many images show each place</summary>" +
            Image("png", pictures.coverage_png, "coverage") + "</details>\n";
  }
  return html;
}

// What joined the submaps, for one who wants to see it.
std::string EdgePictures(const Json& s, const std::map<std::pair<int, int>, std::string>& pictures) {
  std::string html;
  for (const Json& c : s["connections"]) {
    const std::pair<int, int> numbers = std::minmax(c["a"].get<int>(), c["b"].get<int>());
    const auto picture = pictures.find(numbers);
    if (picture == pictures.end() || !c["in_tree"].get<bool>()) continue;
    html += "<figure class=\"edge\">" +
            Image("jpeg", picture->second,
                  "connection of submaps " + std::to_string(numbers.first) + " and " + std::to_string(numbers.second)) +
            "<figcaption>" + Chip(c["a"]) + "–" + Chip(c["b"]) + " " + Escaped(c["reason"]) +
            "</figcaption></figure>\n";
  }
  if (html.empty()) return "";
  return "<h2>What joined the submaps</h2>\n<p class=\"note\">The connected frames of each connection in the tree that "
         "have most in common, and the map points of each that were found in the other. Of other pairs: "
         "<code>mapmend edges show</code>.</p>\n" +
         html;
}

std::string LoopTable(const Json& s) {
  if (!s.contains("loops") || s["loops"].empty()) return "";
  std::string html =
      "<h2>Loops within submaps</h2>\n<div class=\"scroll\"><table>\n<tr><th>Submap</th><th "
      "class=\"text\">Verdict</th><th>F</th>"
      "<th>M</th><th>θ</th><th>C</th><th>Candidates</th><th class=\"text\">Reason</th></tr>\n";
  for (const Json& c : s["loops"]) {
    html += "<tr><td>" + Chip(c["a"]) + "</td><td class=\"text\"><span class=\"verdict " + Escaped(c["verdict"]) +
            "\">" + Escaped(c["verdict"]) + "</span></td><td>" + Int(c["F"]) + "</td><td>" + Int(c["M"]) + "</td><td>" +
            Fixed(c["theta_deg"], 1) + "°</td><td>" + Fixed(c["C"], 1) + "</td><td>" + Int(c["candidates"]) +
            "</td><td class=\"text\">" + Escaped(c["reason"]) + "</td></tr>\n";
  }
  html += "</table></div>\n";
  return html +
         "<p class=\"note\">A submap that comes back to ground it has left: pairs of its own keyframes that see the "
         "same place. "
         "Accepted: the drift of tracking between them is taken out.</p>\n";
}

std::string ProcessTable(const Json& s) {
  if (!s.contains("processes") || s["processes"].empty()) return "";
  std::string html =
      "<h2>Processes</h2>\n<div class=\"scroll\"><table>\n<tr><th class=\"text\">Process</th><th>CPU time</th>"
      "<th>Peak memory</th></tr>\n";
  for (const Json& p : s["processes"]) {
    html += "<tr><td class=\"text\">" + Escaped(p.at("name")) + "</td><td>" + Fixed(p.value("cpu_s", 0.0), 1) +
            " s</td><td>" + Fixed(p.value("peak_rss_mb", 0.0), 0) + " MB</td></tr>\n";
  }
  return html + "</table></div>\n";
}

std::string ProfileTable(const Json& s) {
  if (!s.contains("frontend") || !s["frontend"].contains("profile")) return "";
  std::string html =
      "<h2>Time per frame</h2>\n<div class=\"scroll\"><table>\n<tr><th class=\"text\">Stage of the frontend</th>"
      "<th>Frames</th><th>Median</th><th>95 % below</th><th>Total</th></tr>\n";
  for (const Json& p : s["frontend"]["profile"]) {
    html += "<tr><td class=\"text\">" + Escaped(p.at("stage")) + "</td><td>" + Int(p.at("frames")) + "</td><td>" +
            Fixed(p.at("median_ms"), 2) + " ms</td><td>" + Fixed(p.at("p95_ms"), 2) + " ms</td><td>" +
            Fixed(p.at("total_s"), 2) + " s</td></tr>\n";
  }
  return html +
         "</table></div>\n<p class=\"note\">Of the frames in which a stage ran. Stages named capture/ run ahead in a "
         "thread of "
         "their own; track+map/frame holds all stages of tracking and mapping.</p>\n";
}

std::string Head(const Json& s) {
  std::string lines;
  for (const Json& session : s["sessions"]) {
    std::string line = Escaped(session["source"]);
    if (!session["vehicle"].get<std::string>().empty()) line = Escaped(session["vehicle"]) + ": " + line;
    const std::string date = Date(session["start_utime"]);
    if (!date.empty()) line += ", " + date;
    lines += "<p>" + line + "</p>\n";
  }
  const std::string title = s.value("title", "");
  return "<header><h1>" + (title.empty() ? "Flight report" : EscapeXml(title)) + "</h1>\n" + lines + "</header>\n";
}

}  // namespace

std::string MakeReport(const std::string& summary_json, const ReportPictures& pictures) {
  try {
    const Json s = Json::parse(summary_json);
    std::string html =
        "<!DOCTYPE html>\n<html lang=\"en\"><head><meta charset=\"utf-8\">\n"
        "<meta name=\"viewport\" content=\"width=device-width, initial-scale=1\">\n<title>" +
        EscapeXml(s.value("title", "flight report")) + " (mapmend)</title>\n<style>";
    html += kReportStyle;
    html += "</style></head>\n<body><main>\n" + Head(s) + Banner(s) + Figures(s) + GroundTruthProblem(s) +
            MosaicSection(s, pictures);
    for (const std::string& svg : pictures.trajectory_svgs) html += "<div class=\"picture\">" + svg + "</div>\n";
    html += WhyApart(s) + WorldSection(s) + GapSection(s, pictures.gaps_svg);
    html += "<div class=\"picture graph\">" + pictures.graph_svg + "</div>\n";
    html += RestorationRows(s) + ConnectionTable(s) + EdgePictures(s, pictures.edge_pictures) + LoopTable(s) +
            SubmapTable(s) + ProcessTable(s) + ProfileTable(s);
    html += "<footer>Written by mapmend " + Escaped(s["version"]) +
            ". The figures are in summary.json beside this page.</footer>\n";
    return WithLabels(html) + "</main></body></html>\n";
  } catch (const Json::exception& e) {
    throw std::runtime_error(std::string("summary.json: ") + e.what());
  }
}

}  // namespace mapmend
