#include "libs/merging/refinement_task.h"

#include <algorithm>
#include <utility>

namespace mapmend {
namespace {

// Of the submaps of one component.
class StoredFeatures : public FeatureSource {
 public:
  StoredFeatures(std::unique_ptr<KeyframeSource> source, const std::vector<std::string>* session_of_submap)
      : source_(std::move(source)), session_of_submap_(session_of_submap) {}

  Features Read(int submap, const SubmapKeyframe& keyframe) override {
    return source_->Read((*session_of_submap_)[submap], keyframe.seq).features;
  }

 private:
  std::unique_ptr<KeyframeSource> source_;
  const std::vector<std::string>* session_of_submap_;
};

}  // namespace

RefinementOutcome RunRefinement(const RefinementTask& task, const std::function<void(const std::string&)>& progress,
                                const OpenKeyframeSource& open) {
  RefinementOutcome outcome;
  outcome.transforms = task.transforms;
  outcome.state = task.state;
  outcome.is_final = task.is_final;
  int num_components = 0;
  for (const MergedTransforms::Place& place : task.transforms.submaps) {
    num_components = std::max(num_components, place.component + 1);
  }
  for (int component = 0; component < num_components; ++component) {
    std::vector<int> members, local(task.parts.size(), -1);  // members: indices into task.parts, oldest first
    std::vector<std::string> sessions;
    std::vector<SubmapView> views;
    std::vector<Similarity3> root_from_submap;
    for (size_t i = 0; i < task.parts.size(); ++i) {
      const MergedTransforms::Place& place = task.transforms.submaps[i];
      if (place.component != component) continue;
      local[i] = static_cast<int>(members.size());
      members.push_back(static_cast<int>(i));
      sessions.push_back(place.key.session);
      views.push_back({task.parts[i].submap.get(), task.parts[i].camera, task.parts[i].pyramid, task.parts[i].real,
                       place.key.session});
      root_from_submap.push_back(place.root_from_submap);
    }
    std::vector<RefinementLink> links;
    for (RefinementLink link : task.links) {
      link.submap_a = local[link.submap_a];
      link.submap_b = local[link.submap_b];
      if (link.submap_a >= 0 && link.submap_b >= 0) links.push_back(std::move(link));
    }
    OpenFeatureSource open_features;
    if (open) open_features = [&] { return std::make_unique<StoredFeatures>(open(), &sessions); };
    const MergedRefinementResult result =
        RefineMergedMap(views, root_from_submap, links, task.options, progress, open_features, task.positions);
    if (progress) progress("refinement: " + result.summary.reason);

    std::vector<RefinedSubmap> refined(members.size());
    for (size_t s = 0; s < members.size(); ++s) {
      MergedTransforms::Place& place = outcome.transforms.submaps[members[s]];
      place.root_from_submap = result.root_from_submap[s];
      refined[s].key = place.key;
    }
    for (const MergedKeyframe& k : result.map.keyframes) {
      refined[k.submap].keyframes.push_back({k.keyframe->id, k.cam_from_root, k.scale});
    }
    // Of a flight in several components the one with most frames says it: the first.
    for (size_t s = 0; s < members.size(); ++s) {
      if (result.map.shutters[s].readout != 0) outcome.shutters.emplace(sessions[s], result.map.shutters[s]);
    }
    for (const MergedPoint& p : result.map.points) {
      if (p.track.empty()) continue;
      const auto& [first_submap, first_id] = p.first;
      if (!first_id.IsValid()) continue;  // a wide one
      refined[first_submap].points.push_back({first_id, p.position.cast<float>()});
      for (const auto& [submap, id] : p.fused) {
        refined[submap].fused.push_back({id, refined[first_submap].key.session, first_id});
      }
    }
    outcome.submaps.insert(outcome.submaps.end(), refined.begin(), refined.end());
  }
  return outcome;
}

}  // namespace mapmend
