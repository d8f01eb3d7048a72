#include "procs/frontend/second_opinion.h"

#include <algorithm>
#include <iterator>
#include <optional>
#include <utility>

#include "libs/base/median.h"
#include "libs/optim/bundle_adjustment.h"
#include "procs/frontend/profiler.h"
#include "procs/frontend/submap_starter.h"

namespace mapmend {
namespace {

constexpr int kEarliest = 5;               // keyframes: with fewer everything fits
constexpr size_t kMaxPartners = 40;        // that are tried for a beginning with one frame
constexpr double kMinShareOfPoints = 0.5;  // that a wider beginning must have, of the best one with that frame
constexpr int kMaxTrialShare = 3;          // of the frames, one in so many may be no beginning

// Keyframes that have their features, the newest image first.
std::vector<KeyframeIndex> NewestFirst(const WorkingMap& map) {
  std::vector<KeyframeIndex> order;
  for (KeyframeIndex k(0); k <= map.LastKeyframe(); ++k) {
    if (!map.Keyframe(k).removed) order.push_back(k);
  }
  std::stable_sort(order.begin(), order.end(), [&](KeyframeIndex a, KeyframeIndex b) {
    return map.Keyframe(a).frame->utime > map.Keyframe(b).frame->utime;
  });
  return order;
}

// How much larger lengths are in a map than in another, by the depths in one keyframe of both; nothing if they have no
// feature in common.
std::optional<double> ScaleAt(const WorkingMap& map, KeyframeIndex keyframe, const WorkingMap& other,
                              KeyframeIndex keyframe_other) {
  const WorkingKeyframe &k = map.Keyframe(keyframe), &l = other.Keyframe(keyframe_other);
  std::vector<double> ratios;
  for (size_t f = 0; f < k.points.size(); ++f) {
    if (k.points[f].IsNone() || l.points[f].IsNone()) continue;
    const double depth = (k.cam_from_submap * map.Point(k.points[f]).position).z(),
                 depth_other = (l.cam_from_submap * other.Point(l.points[f]).position).z();
    if (depth > 0 && depth_other > 0) ratios.push_back(depth / depth_other);
  }
  return ratios.empty() ? std::nullopt : std::optional(Median(std::move(ratios)));
}

Rigid3 Scaled(Rigid3 pose, double scale) {
  pose.translation *= scale;
  return pose;
}

}  // namespace

double SecondOpinion::Misfit(const WorkingMap& map, int* num_observations) const {
  std::vector<double> errors;
  for (const WorkingPoint& point : map.Points()) {
    if (point.removed) continue;
    for (const WorkingObservation& o : point.observations) {
      const WorkingKeyframe& k = map.Keyframe(o.keyframe);
      const Keypoint& keypoint = k.frame->features.keypoints[o.feature];
      errors.push_back(ReprojectionChi2(camera_, k.cam_from_submap, point.position, keypoint.pixel.cast<double>(),
                                        pyramid_.Sigma(keypoint.octave)));
    }
  }
  *num_observations = static_cast<int>(errors.size());
  return Median(std::move(errors));
}

bool SecondOpinion::IsDoubted(double misfit) {
  if (least_misfit_ == 0 || misfit < least_misfit_) least_misfit_ = misfit;
  return misfit > options_.max_misfit && misfit > options_.min_growth * least_misfit_ &&
         misfit > options_.next_growth * doubted_at_;
}

std::optional<std::vector<PointIndex>> SecondOpinion::Seek(WorkingMap* map) {
  const int num_keyframes = map->LastKeyframe() + 1;
  if (num_keyframes < kEarliest || num_keyframes > options_.max_keyframes) return std::nullopt;
  const StageTimer timer("map/second_opinion");
  int num_observations = 0, num_observations_rival = 0;
  double misfit = Misfit(*map, &num_observations);
  if (!IsDoubted(misfit) || num_keyframes < options_.min_keyframes) return std::nullopt;
  doubted_at_ = misfit;
  const Rival rival = MapBackwards(*map);
  if (!rival.map) return std::nullopt;
  const double misfit_rival = Misfit(*rival.map, &num_observations_rival);
  if (misfit_rival > options_.max_misfit_ratio * misfit ||
      num_observations_rival < options_.min_observations * num_observations)
    return std::nullopt;
  // The rival was adjusted as a whole, the map only bit by bit. What then fits may be little that is left.
  mapper_->AdjustAll(map);
  misfit = Misfit(*map, &num_observations);
  const bool is_mended = misfit_rival > options_.max_misfit_ratio * misfit &&
                         num_observations >= options_.min_observations * num_observations_rival;
  if (is_mended) return std::nullopt;
  least_misfit_ = misfit_rival;
  doubted_at_ = 0;
  return TakeOver(rival, map);
}

Initialization SecondOpinion::BeginAt(const std::vector<FramePtr>& frames, size_t first, size_t* second) const {
  Initializer initializer(initializer_options_, camera_, pyramid_);
  Initialization best;
  size_t most_points = 0;
  const size_t end = std::min(frames.size(), first + 1 + kMaxPartners);
  for (size_t i = first; i + 1 < end; ++i) {
    initializer.Keep(frames[i]);
    Initialization wider = initializer.BeginWith(frames[first], frames[i + 1]);
    if (!wider.success && wider.reason == LossReason::kTooFewMatches) break;
    most_points = std::max(most_points, wider.points.size());
    if (!wider.success ||
        static_cast<double>(wider.points.size()) < kMinShareOfPoints * static_cast<double>(most_points))
      continue;
    best = std::move(wider);
    *second = i + 1;
  }
  return best;
}

SecondOpinion::Rival SecondOpinion::MapBackwards(const WorkingMap& map) const {
  const std::vector<KeyframeIndex> order = NewestFirst(map);
  std::vector<FramePtr> frames;
  frames.reserve(order.size());
  for (const KeyframeIndex k : order) frames.push_back(map.Keyframe(k).frame);
  size_t first = 0, second = 0;
  Initialization beginning;
  while (!beginning.success && kMaxTrialShare * first < frames.size()) {
    beginning = BeginAt(frames, first, &second);
    if (!beginning.success) ++first;
  }
  if (!beginning.success) return {};
  IdSource ids;
  Rival rival;
  rival.map = MapOfBeginning(beginning, SubmapId(0), pyramid_, mapper_, &ids);
  rival.original = {order[first], order[second]};
  KeyframeIndex last(1);
  const auto add = [&](size_t i, const std::vector<KeyframeIndex>& hints) {
    const TrackResult tracked = tracker_->Track(std::nullopt, hints, *frames[i], rival.map.get());
    if (!tracked.success) return;
    last = rival.map->AddKeyframe(frames[i], tracked.cam_from_submap, tracked.points);
    rival.original.push_back(order[i]);
    mapper_->Process(last, rival.map.get());
  };
  for (size_t i = first + 1; i < second; ++i) add(i, {KeyframeIndex(0), KeyframeIndex(1), last});
  last = KeyframeIndex(1);
  for (size_t i = second + 1; i < frames.size(); ++i) add(i, {last, KeyframeIndex(std::max(0, last - 1))});
  last = KeyframeIndex(0);
  for (size_t i = first; i-- > 0;) add(i, {last, KeyframeIndex(0)});
  mapper_->AdjustAll(rival.map.get());
  const bool has_newest = std::find(rival.original.begin(), rival.original.end(), order[0]) != rival.original.end();
  if (!has_newest ||
      static_cast<double>(rival.original.size()) < options_.min_kept_share * static_cast<double>(order.size()))
    rival.map.reset();
  return rival;
}

// What was not placed keeps its place beside the keyframe behind it.
void SecondOpinion::TakePoses(const Rival& rival, double scale, const Rigid3& submap_from_rival,
                              WorkingMap* map) const {
  Rigid3 neighbour_before, neighbour;
  for (const KeyframeIndex k : NewestFirst(*map)) {
    const auto placed = std::find(rival.original.begin(), rival.original.end(), k);
    const Rigid3 before = map->Keyframe(k).cam_from_submap;
    if (placed == rival.original.end()) {
      map->SetPose(k, before * neighbour_before.Inverse() * neighbour);
      continue;
    }
    const KeyframeIndex r(static_cast<int>(placed - rival.original.begin()));
    neighbour_before = before;
    neighbour = Scaled(rival.map->Keyframe(r).cam_from_submap, scale) * submap_from_rival.Inverse();
    map->SetPose(k, neighbour);
  }
}

std::vector<PointIndex> SecondOpinion::TakeOver(const Rival& rival, WorkingMap* map) const {
  const KeyframeIndex newest = NewestFirst(*map).front();
  const KeyframeIndex newest_of_rival(
      static_cast<int>(std::find(rival.original.begin(), rival.original.end(), newest) - rival.original.begin()));
  const double scale = ScaleAt(*map, newest, *rival.map, newest_of_rival).value_or(1);
  const Rigid3 submap_from_rival = map->Keyframe(newest).cam_from_submap.Inverse() *
                                   Scaled(rival.map->Keyframe(newest_of_rival).cam_from_submap, scale);
  TakePoses(rival, scale, submap_from_rival, map);
  const std::vector<WorkingKeyframe> before = map->Keyframes();
  const int num_points = static_cast<int>(map->Points().size());
  for (PointIndex p(0); p < num_points; ++p) map->RemovePoint(p);
  std::vector<PointIndex> new_of_old(num_points);
  for (const WorkingPoint& point : rival.map->Points()) {
    if (point.removed) continue;
    KeyframeIndex first = newest;
    for (const WorkingObservation& o : point.observations) first = std::min(first, rival.original[o.keyframe]);
    const PointIndex p = map->AddPoint(submap_from_rival * (scale * point.position), first);
    for (const WorkingObservation& o : point.observations) {
      const KeyframeIndex k = rival.original[o.keyframe];
      map->AddObservation(p, k, o.feature);
      if (const PointIndex old = before[k].points[o.feature]; !old.IsNone()) new_of_old[old] = p;
    }
    map->RefreshPoint(p);
  }
  return new_of_old;
}

}  // namespace mapmend
