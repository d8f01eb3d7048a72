#include "procs/viewer_export/connection_matches.h"

#include <algorithm>
#include <cmath>
#include <set>
#include <tuple>

#include "libs/features/matching.h"
#include "libs/retrieval/bow_vector.h"

namespace mapmend {
namespace {

// About where the map says that a point is seen. The transform between two submaps fits their connected frames
// together, each of them less well: what all are off by is found first.
constexpr float kFirstRadius = 40, kSecondRadius = 6;  // pixels at octave 0
constexpr int kMaxDistance = 64;                       // bits
constexpr double kRatio = 0.9;
constexpr size_t kMostLooked = 30;   // keyframes of each submap, evenly chosen, of a rejected connection ...
constexpr size_t kMostMatched = 12;  // ... and pairs of them that are matched
constexpr size_t kLeastMatches = 4;  // fewer say nothing

// One side of a connection.
struct Side {
  const SnapshotSubmap* submap = nullptr;
  const SubmapKeyframe* keyframe = nullptr;
  KeyframeRecord record;  // its features
  Pinhole camera;
  FeatureGrid grid;
};

std::optional<Side> ReadSide(const Snapshot& snapshot, const SubmapKey& key, KeyframeId id,
                             const FetchKeyframe& fetch) {
  const int index = snapshot.FindSubmap(key);
  if (index < 0 || !fetch) return std::nullopt;
  Side side;
  side.submap = &snapshot.submaps[static_cast<size_t>(index)];
  const auto keyframe = side.submap->submap->keyframes.find(id);
  if (keyframe == side.submap->submap->keyframes.end()) return std::nullopt;  // culled since
  side.keyframe = &keyframe->second;
  std::optional<KeyframeRecord> record = fetch(key.session, keyframe->second.seq);
  if (!record) return std::nullopt;
  side.record = std::move(*record);
  side.camera = snapshot.model->GetSession(key.session).info.pinhole;
  side.grid = FeatureGrid(side.record.features.keypoints, side.camera.width, side.camera.height);
  return side;
}

// A map point of one side, predicted in the other.
struct Prediction {
  int feature = -1;
  Eigen::Vector2f pixel;
};

std::vector<Prediction> Predict(const Side& from, const Side& to, const Similarity3& to_from) {
  std::vector<Prediction> predictions;
  for (int i = 0; i < from.record.features.Size(); ++i) {
    const auto point = from.submap->submap->points.find(from.keyframe->map_points[static_cast<size_t>(i)]);
    if (point == from.submap->submap->points.end()) continue;
    const Eigen::Vector3d in_camera = to.keyframe->cam_from_submap * (to_from * point->second.position.cast<double>());
    if (in_camera.z() <= 0) continue;
    const Eigen::Vector2d pixel = to.camera.Project(in_camera);
    if (pixel.x() < 0 || pixel.y() < 0 || pixel.x() >= to.camera.width || pixel.y() >= to.camera.height) continue;
    predictions.push_back({i, pixel.cast<float>()});
  }
  return predictions;
}

// Feature of `to` that is most like a feature and near a pixel; -1: none, or two alike.
int FindNear(const Side& to, const Descriptor& descriptor, const Eigen::Vector2f& pixel, float radius) {
  int best = -1, best_distance = kMaxDistance + 1, second_distance = 257;
  to.grid.VisitNear(pixel, radius, [&](int i) {
    if ((to.record.features.keypoints[static_cast<size_t>(i)].pixel - pixel).norm() > radius) return;
    const int distance = HammingDistance(descriptor, to.record.features.descriptors[static_cast<size_t>(i)]);
    if (distance < best_distance) {
      second_distance = best < 0 ? 257 : best_distance;
      best_distance = distance;
      best = i;
    } else {
      second_distance = std::min(second_distance, distance);
    }
  });
  return best >= 0 && best_distance < kRatio * second_distance ? best : -1;
}

// Pairs of features (of from, of to).
std::vector<std::pair<int, int>> MatchGuided(const Side& from, const Side& to, const Similarity3& to_from) {
  const std::vector<Prediction> predictions = Predict(from, to, to_from);
  Eigen::Vector2f offset = Eigen::Vector2f::Zero();
  std::vector<std::pair<int, int>> pairs;
  for (const float radius : {kFirstRadius, kSecondRadius}) {
    pairs.clear();
    std::vector<float> x, y;
    for (const Prediction& p : predictions) {
      const Descriptor& descriptor = from.record.features.descriptors[static_cast<size_t>(p.feature)];
      const int found = FindNear(to, descriptor, p.pixel + offset, radius);
      if (found < 0) continue;
      const Eigen::Vector2f off = to.record.features.keypoints[static_cast<size_t>(found)].pixel - p.pixel;
      x.push_back(off.x());
      y.push_back(off.y());
      pairs.emplace_back(p.feature, found);
    }
    if (pairs.empty()) return pairs;
    for (std::vector<float>* values : {&x, &y})
      std::nth_element(values->begin(), values->begin() + static_cast<long>(values->size() / 2), values->end());
    offset = {x[x.size() / 2], y[y.size() / 2]};
  }
  return pairs;
}

ConnectionMatches Describe(const Side& a, const Side& b, const std::set<std::pair<int, int>>& pairs) {
  ConnectionMatches result;
  result.a = a.keyframe->id;
  result.b = b.keyframe->id;
  for (const auto& [i, j] : pairs) {
    result.matches.emplace_back(a.record.features.keypoints[static_cast<size_t>(i)].pixel,
                                b.record.features.keypoints[static_cast<size_t>(j)].pixel);
  }
  return result;
}

std::optional<ConnectionMatches> MatchVerified(const Snapshot& snapshot, const EvaluatedConnection& connection,
                                               const FetchKeyframe& fetch) {
  std::vector<EvaluatedConnection::FramePair> pairs = connection.pairs;
  std::stable_sort(pairs.begin(), pairs.end(),
                   [](const auto& p, const auto& q) { return p.num_inliers > q.num_inliers; });
  for (const EvaluatedConnection::FramePair& pair : pairs) {
    const auto a = ReadSide(snapshot, connection.a, pair.a, fetch), b = ReadSide(snapshot, connection.b, pair.b, fetch);
    if (!a || !b) continue;
    std::set<std::pair<int, int>> found;
    for (const auto& match : MatchGuided(*a, *b, connection.b_from_a)) found.insert(match);
    for (const auto& [j, i] : MatchGuided(*b, *a, connection.b_from_a.Inverse())) found.emplace(i, j);
    ConnectionMatches result = Describe(*a, *b, found);
    result.are_inliers = true;
    return result;
  }
  return std::nullopt;
}

std::vector<KeyframeRecord> ReadSome(const Snapshot& snapshot, const SubmapKey& key, const FetchKeyframe& fetch) {
  std::vector<KeyframeRecord> records;
  const int index = snapshot.FindSubmap(key);
  if (index < 0 || !fetch) return records;
  const auto& keyframes = snapshot.submaps[static_cast<size_t>(index)].submap->keyframes;
  const size_t step = (keyframes.size() + kMostLooked - 1) / kMostLooked;
  size_t number = 0;
  for (const auto& [id, keyframe] : keyframes) {
    if (number++ % step != 0) continue;
    if (auto record = fetch(key.session, keyframe.seq)) records.push_back(std::move(*record));
  }
  return records;
}

std::optional<ConnectionMatches> MatchAlike(const Snapshot& snapshot, const EvaluatedConnection& connection,
                                            const FetchKeyframe& fetch) {
  const std::vector<KeyframeRecord> of_a = ReadSome(snapshot, connection.a, fetch),
                                    of_b = ReadSome(snapshot, connection.b, fetch);
  std::vector<std::tuple<double, size_t, size_t>> scores;
  for (size_t i = 0; i < of_a.size(); ++i) {
    for (size_t j = 0; j < of_b.size(); ++j) scores.emplace_back(-BowScore(of_a[i].bow, of_b[j].bow), i, j);
  }
  std::sort(scores.begin(), scores.end());
  scores.resize(std::min(scores.size(), kMostMatched));
  std::optional<ConnectionMatches> best;
  for (const auto& [score, i, j] : scores) {
    const std::vector<Match> matches = MatchBruteForce(of_a[i].features, of_b[j].features, MatchOptions());
    if (matches.size() < kLeastMatches || (best && matches.size() <= best->matches.size())) continue;
    best.emplace();
    best->a = of_a[i].keyframe;
    best->b = of_b[j].keyframe;
    for (const Match& match : matches) {
      best->matches.emplace_back(of_a[i].features.keypoints[static_cast<size_t>(match.a)].pixel,
                                 of_b[j].features.keypoints[static_cast<size_t>(match.b)].pixel);
    }
  }
  return best;
}

}  // namespace

std::optional<ConnectionMatches> MatchConnection(const Snapshot& snapshot, const EvaluatedConnection& connection,
                                                 const FetchKeyframe& fetch) {
  if (!connection.pairs.empty()) {
    if (auto matches = MatchVerified(snapshot, connection, fetch)) return matches;
  }
  return MatchAlike(snapshot, connection, fetch);
}

}  // namespace mapmend
