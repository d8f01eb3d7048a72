#include "procs/viewer_export/gap_report.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <map>
#include <set>
#include <utility>

#include "libs/base/degree.h"
#include "libs/base/median.h"
#include "libs/base/rounded.h"
#include "libs/base/text_format.h"
#include "libs/map_view/dead_reckoning.h"
#include "procs/viewer_export/holes.h"

namespace mapmend {
namespace {

std::string PartName(int component) { return component == 0 ? "the main map" : "part " + std::to_string(component); }

double LengthOf(const std::vector<Eigen::Vector3d>& line) {
  double length = 0;
  for (size_t i = 1; i < line.size(); ++i) length += (line[i] - line[i - 1]).head<2>().norm();
  return length;
}

// Where the receiver was between two times of the camera; the ends of the map's path if it tells nothing.
std::vector<Eigen::Vector3d> PathBetween(const SessionFixes& fixes, const WorldPlacement& world, int session,
                                         int64_t from, int64_t to) {
  std::vector<Eigen::Vector3d> path;
  const int64_t offset = world.clocks[static_cast<size_t>(session)].offset_us;
  for (const PositionFix& fix : fixes.fixes) {
    if (fix.utime + offset < from || fix.utime + offset > to) continue;
    path.push_back(world.frame.ToEnu(
        {fix.latitude_deg, fix.longitude_deg, fix.HasAltitude() ? fix.altitude_m : world.frame.origin().altitude_m}));
  }
  return path;
}

struct Known {
  int64_t utime = 0;
  int component = 0;
  Eigen::Vector3d center;
};

// Frames of a session in any part, by number.
std::map<int, Known> FramesOf(const Snapshot& snapshot, int session) {
  std::map<int, Known> frames;
  for (int c = 0; c < static_cast<int>(snapshot.components.size()); ++c) {
    for (const MergedFrame& frame : snapshot.components[c].frames) {
      if (frame.session == session)
        frames.try_emplace(frame.frame, Known{frame.utime, c, frame.cam_from_root.Center()});
    }
  }
  return frames;
}

void FindStretches(const Snapshot& snapshot, const WorldPlacement* world, GapReport* report) {
  const std::vector<SessionFixes> fixes = PositionsOf(snapshot);
  const std::set<int> looked_at(report->components.begin(), report->components.end());
  for (const MapHole& hole : FindHolesOfAll(snapshot)) {
    const std::map<int, Known> frames = FramesOf(snapshot, hole.session);
    Gap gap;
    gap.kind = Gap::Kind::kStretch;
    gap.session = hole.session;
    gap.first_frame = hole.first_frame;
    gap.last_frame = hole.last_frame;
    gap.seconds = 1e-6 * static_cast<double>(hole.duration_us);
    const auto behind = hole.last_frame < 0 ? frames.end() : frames.upper_bound(hole.last_frame);
    const auto at = frames.lower_bound(hole.first_frame);
    const Known* before = at == frames.begin() ? nullptr : &std::prev(at)->second;
    const Known* after = behind == frames.end() ? nullptr : &behind->second;
    const auto is_known = [&](const Known* k) { return k != nullptr && looked_at.contains(k->component); };
    if (is_known(before)) gap.line.push_back(report->level_from_world * before->center);
    if (world != nullptr && report->is_placed) {
      const int64_t from = before != nullptr ? before->utime : std::numeric_limits<int64_t>::min() / 2;
      const int64_t to = after != nullptr ? after->utime : std::numeric_limits<int64_t>::max() / 2;
      const auto path = PathBetween(fixes[static_cast<size_t>(hole.session)], *world, hole.session, from + 1, to - 1);
      gap.line.insert(gap.line.end(), path.begin(), path.end());
    }
    if (is_known(after)) gap.line.push_back(report->level_from_world * after->center);
    if (gap.line.size() < 2) gap.line.clear();
    gap.length = LengthOf(gap.line);
    gap.text = gap.last_frame < 0 ? Format("from frame %d to the end of the flight there is no map", gap.first_frame)
               : gap.first_frame == gap.last_frame
                   ? Format("of frame %d there is no map", gap.first_frame)
                   : Format("of frames %d to %d there is no map", gap.first_frame, gap.last_frame);
    if (gap.seconds > 0) gap.text += Format(": %.1f s", gap.seconds);
    if (gap.length > 0) gap.text += ", " + Rounded(gap.length) + " " + report->Unit();
    report->gaps.push_back(gap);
  }
}

struct Join {
  int a = 0, b = 0;
  double distance = 0;
  Eigen::Vector3d from, to;
};

Join NearestKeyframes(const Snapshot& snapshot, int a, int b) {
  Join join{a, b, std::numeric_limits<double>::infinity(), {}, {}};
  for (const SnapshotKeyframe& k : snapshot.components[a].keyframes) {
    const Eigen::Vector3d from = k.cam_from_root.Center();
    for (const SnapshotKeyframe& l : snapshot.components[b].keyframes) {
      const Eigen::Vector3d to = l.cam_from_root.Center();
      const double distance = (to - from).head<2>().norm();
      if (distance >= join.distance) continue;
      join.distance = distance;
      join.from = from;
      join.to = to;
    }
  }
  return join;
}

// The shortest lines that would join all parts in one world (a minimum spanning tree), each long enough that images at
// both ends look into both parts.
void FindConnections(const Snapshot& snapshot, GapReport* report) {
  const std::vector<int>& parts = report->components;
  std::vector<Join> joins;
  for (size_t i = 0; i < parts.size(); ++i) {
    for (size_t k = i + 1; k < parts.size(); ++k) joins.push_back(NearestKeyframes(snapshot, parts[i], parts[k]));
  }
  std::stable_sort(joins.begin(), joins.end(), [](const Join& a, const Join& b) { return a.distance < b.distance; });
  std::map<int, int> group;
  for (const int part : parts) group[part] = part;
  for (const Join& join : joins) {
    if (!std::isfinite(join.distance) || group[join.a] == group[join.b]) continue;
    const int merged = group[join.a], other = group[join.b];
    for (auto& [part, g] : group) g = g == other ? merged : g;
    Gap gap;
    gap.kind = Gap::Kind::kConnection;
    gap.component_a = join.a;
    gap.component_b = join.b;
    const double heading = report->style.heading_deg * kDegree;
    Eigen::Vector3d along(std::sin(heading), std::cos(heading), 0);
    if (join.distance > 0.1 * report->style.footprint_length) along = (join.to - join.from) / join.distance;
    along.z() = 0;
    const double beyond = std::max(report->style.footprint_length, report->style.footprint_width);
    gap.line = {join.from - beyond * along, join.to + beyond * along};
    gap.length = LengthOf(gap.line);
    const bool overlap = join.distance < 0.5 * beyond;
    gap.text = Format("nothing joins %s and %s", PartName(join.a).c_str(), PartName(join.b).c_str());
    gap.text += overlap ? Format(", though they lie on each other; a line of %.0f m there could", gap.length)
                        : Format("; they are %.0f m apart at least: a line of %.0f m could", join.distance, gap.length);
    report->gaps.push_back(gap);
  }
  // Parts whose place is not known.
  const std::vector<LikelyPlace> places = FindLikelyPlaces(snapshot);
  for (int c = 0; c < static_cast<int>(snapshot.components.size()); ++c) {
    if (std::find(parts.begin(), parts.end(), c) != parts.end() || snapshot.components[c].frames.empty()) continue;
    Gap gap;
    gap.kind = Gap::Kind::kConnection;
    gap.component_b = c;
    const auto& frames = snapshot.components[c].frames;
    gap.text = Format("nothing joins %s (frames %d to %d) and the main map; where it lies is not known",
                      PartName(c).c_str(), frames.front().frame, frames.back().frame);
    const auto place = std::find_if(places.begin(), places.end(), [&](const LikelyPlace& p) {
      return snapshot.submaps[p.earlier].component == c || snapshot.submaps[p.later].component == c;
    });
    if (place != places.end()) gap.text += ": " + DescribeLikelyPlace(*place, snapshot);
    report->gaps.push_back(gap);
  }
}

void FindGround(GapReport* report, const CoverageOptions& options) {
  report->coverage = MeasureCoverage(report->footprints, options);
  const char* square = report->is_placed ? "m²" : "square map units";
  for (const CoverageRegion& region : report->coverage.regions) {
    Gap gap;
    gap.kind = Gap::Kind::kGround;
    gap.region = region;
    if (region.area_unseen > 0.99 * region.area) {
      gap.text = "no image sees " + Rounded(region.area) + " " + square;
    } else {
      gap.text = Format("fewer than %d images see ", options.min_images) + Rounded(region.area) + " " + square;
      if (region.area_unseen > 0) gap.text += ", none " + Rounded(region.area_unseen) + " of them";
    }
    report->gaps.push_back(gap);
  }
}

constexpr size_t kHeadingBins = 36;  // of 180 degrees: strips have no direction

// The heading that most of the way was flown in, among its neighbours: flights that cross have several.
double UsualHeading(const std::array<double, kHeadingBins>& flown) {
  const auto at = [&](size_t bin) { return flown[bin % kHeadingBins]; };
  const auto around = [&](size_t bin) { return at(bin + kHeadingBins - 1) + at(bin) + at(bin + 1); };
  size_t best = 0;
  for (size_t bin = 1; bin < kHeadingBins; ++bin) {
    if (around(bin) > around(best)) best = bin;
  }
  if (!(around(best) > 0)) return 0;
  const double offset = (at(best + 1) - at(best + kHeadingBins - 1)) / around(best);
  return std::fmod((static_cast<double>(best) + 0.5 + offset) * 180 / kHeadingBins + 180, 180);
}

FlightStyle StyleOf(const Snapshot& snapshot, const std::vector<Ground>& grounds, const std::vector<int>& components) {
  FlightStyle style;
  std::vector<double> heights, lengths, widths, overlaps, speeds, pitches;
  std::array<double, kHeadingBins> flown = {};  // lengths by heading
  for (const Ground& ground : grounds) {
    heights.push_back(ground.height);
    for (size_t i = 0; i < ground.footprints.size(); ++i) {
      const Footprint& f = ground.footprints[i];
      lengths.push_back(f.Length());
      widths.push_back(f.Width());
      if (i == 0) continue;
      const Footprint& before = ground.footprints[i - 1];
      if (before.submap != f.submap) continue;
      const Eigen::Vector2d step = (f.camera - before.camera).head<2>();
      const double heading = std::fmod(std::atan2(step.x(), step.y()) / kDegree + 360, 180);
      flown[static_cast<size_t>(heading / 180 * kHeadingBins) % kHeadingBins] += step.norm();
      if (f.Length() > 0) overlaps.push_back(1 - step.norm() / f.Length());
      const double seconds = 1e-6 * static_cast<double>(f.utime - before.utime);
      if (seconds > 0) speeds.push_back(step.norm() / seconds);
    }
  }
  for (size_t i = 0; i < components.size(); ++i) {
    for (const SnapshotKeyframe& k : snapshot.components[components[i]].keyframes) {
      const Eigen::Vector3d forward =
          grounds[i].level_from_world.rotation * (k.cam_from_root.rotation.conjugate() * Eigen::Vector3d::UnitZ());
      pitches.push_back(std::asin(std::clamp(forward.z(), -1.0, 1.0)) / kDegree);
    }
  }
  style.height = Median(heights);
  style.footprint_length = Median(lengths);
  style.footprint_width = Median(widths);
  style.forward_overlap = std::clamp(Median(overlaps), 0.0, 0.95);
  style.speed = Median(speeds);
  style.pitch_deg = Median(pitches);
  style.heading_deg = UsualHeading(flown);
  return style;
}

}  // namespace

GapReport FindGaps(const Snapshot& placed, const WorldPlacement* world, const CoverageOptions& options) {
  GapReport report;
  for (size_t c = 0; world != nullptr && c < world->components.size(); ++c) {
    if (world->components[c].success) report.components.push_back(static_cast<int>(c));
  }
  report.is_placed = !report.components.empty();
  if (!report.is_placed && !placed.components.empty()) report.components = {0};
  std::vector<Ground> grounds;
  std::vector<int> with_ground;
  for (const int c : report.components) {
    const std::optional<Ground> ground = FindGround(placed, c, report.is_placed);
    if (!ground) continue;
    grounds.push_back(*ground);
    with_ground.push_back(c);
    report.footprints.insert(report.footprints.end(), ground->footprints.begin(), ground->footprints.end());
  }
  report.has_ground = !grounds.empty();
  if (report.has_ground) {
    report.level_from_world = grounds[0].level_from_world;
    report.style = StyleOf(placed, grounds, with_ground);
  }
  FindStretches(placed, world, &report);
  FindConnections(placed, &report);
  if (report.has_ground) FindGround(&report, options);
  return report;
}

}  // namespace mapmend
