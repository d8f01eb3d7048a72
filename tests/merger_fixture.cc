#include "tests/merger_fixture.h"

#include <algorithm>
#include <cmath>

#include "libs/geometry/sim3_closed_form.h"

namespace mapmend::testing {

std::vector<BowProposal> BruteForceBow::Query(const BowQuestion& question) {
  const KeyframeRecord* query = nullptr;
  for (const Record& r : records_) {
    const auto* k = std::get_if<KeyframeRecord>(&r.body);
    if (k && r.header.session == question.session && k->keyframe == question.keyframe) query = k;
  }
  std::vector<BowProposal> proposals;
  for (const Record& r : records_) {
    const auto* k = std::get_if<KeyframeRecord>(&r.body);
    if (!k) continue;
    const auto cursor = std::find_if(question.cursors.begin(), question.cursors.end(),
                                     [&](const StreamCursor& c) { return c.session == r.header.session; });
    if (cursor == question.cursors.end() || r.header.seq > cursor->seq) continue;
    const bool same = r.header.session == question.session && k->submap == query->submap;
    if (same && (!question.same_submap || std::abs(k->keyframe.value - question.keyframe.value) < 6)) continue;
    const double score = BowScore(query->bow, k->bow);
    if (score > 0.05) proposals.push_back({r.header.session, k->submap, k->keyframe, static_cast<float>(score)});
  }
  std::stable_sort(proposals.begin(), proposals.end(),
                   [](const BowProposal& l, const BowProposal& r) { return l.group_score > r.group_score; });
  if (static_cast<int>(proposals.size()) > question.max_results) proposals.resize(question.max_results);
  ++num_queries_;
  return proposals;
}

const std::vector<TerrainPoint>& Terrain() {
  static const std::vector<TerrainPoint> terrain = MakeTerrain({});
  return terrain;
}

SubmapView ViewOf(const Session& session, int submap) {
  return {&session.submaps.at(SubmapId(submap)), session.info.pinhole, session.info.pyramid};
}

Similarity3 Frame(double scale, double angle) {
  return {scale, Eigen::Quaterniond(Eigen::AngleAxisd(angle, Eigen::Vector3d(1, 2, -1).normalized())),
          Eigen::Vector3d(3, -2, 7)};
}

SyntheticFlight ThreeCrossingStrips() {
  std::mt19937_64 random(31);
  SyntheticFlight flight("11111111-0000-0000-0000-000000000000", 1000, Terrain(), {});
  flight.AddSubmap(Strip({100, 100}, {240, 100}, 100, 8, 90, &random), Frame(0.02, 0.3));
  flight.AddSubmap(Strip({170, 80}, {170, 320}, 100, 12, 0, &random), Frame(0.05, -0.9));
  flight.AddSubmap(Strip({240, 290}, {100, 290}, 100, 8, 270, &random), Frame(0.01, 2.0));
  flight.End();
  return flight;
}

double MergedError(const Recorder& out, const std::vector<Rigid3>& world_from_keyframe) {
  std::vector<Eigen::Vector3d> estimated, truth;
  for (const RefinedSubmap& s : out.submaps) {
    for (const RefinedSubmap::Keyframe& k : s.keyframes) {
      estimated.push_back(k.cam_from_root.Center());
      truth.push_back(world_from_keyframe[k.id.value].translation);
    }
  }
  const Similarity3 t = *HornAlignment(estimated, truth);
  double sum = 0;
  for (size_t i = 0; i < truth.size(); ++i) sum += (t * estimated[i] - truth[i]).squaredNorm();
  return std::sqrt(sum / static_cast<double>(truth.size()));
}

std::string Digest(const Recorder& out) {
  std::string text;
  const auto add = [&](const auto& values) {
    for (const double v : values) text += std::to_string(v) + " ";
  };
  for (const auto& place : out.revision.submaps) {
    text += std::to_string(place.component) + ":";
    add(ToArray(place.root_from_submap));
  }
  for (const Connection& c : out.final_connections) text += c.reason + (c.in_tree ? " tree\n" : "\n");
  for (const RefinedSubmap& s : out.submaps) {
    for (const auto& k : s.keyframes) add(ToArray(k.cam_from_root));
    for (const auto& p : s.points) add(std::vector<float>{p.position.x(), p.position.y(), p.position.z()});
    text += std::to_string(s.fused.size()) + "\n";
  }
  return text;
}

}  // namespace mapmend::testing
