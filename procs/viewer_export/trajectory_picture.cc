#include "procs/viewer_export/trajectory_picture.h"

#include <cstdio>

#include "libs/drawing/top_view.h"
#include "procs/viewer_export/graph_export.h"

namespace mapmend {
namespace {

std::string Subtitle(const Snapshot& snapshot, const SnapshotComponent& component, const Evaluation* evaluation) {
  std::string text = std::to_string(component.frames.size()) + " of " + std::to_string(snapshot.num_frames_in) +
                     " frames, " + std::to_string(component.submaps.size()) +
                     (component.submaps.size() == 1 ? " submap" : " submaps");
  if (evaluation != nullptr && evaluation->success) {
    char error[96];
    std::snprintf(error, sizeof(error), "; against ground truth: RMSE %.3f m, max %.3f m", evaluation->rmse,
                  evaluation->max);
    text += error;
  }
  return text;
}

}  // namespace

std::string MakeTrajectorySvg(const Snapshot& snapshot, int component_index, const TrajectoryPictureOptions& options) {
  const SnapshotComponent& component = snapshot.components[component_index];
  const Evaluation* evaluation = options.evaluation;
  const Trajectory* ground_truth = options.ground_truth;
  const bool aligned = ground_truth != nullptr && evaluation != nullptr && evaluation->success;
  const Similarity3 view_from_root = aligned ? evaluation->reference_from_estimate : Similarity3();
  const PlaneView plane = aligned ? GroundPlane(*ground_truth) : DominantPlane(ToTrajectory(component.frames));
  TopView view;
  view.title = component_index == 0 ? "The map from above" : "Part " + std::to_string(component_index) + " from above";
  view.subtitle = Subtitle(snapshot, component, evaluation);
  view.unit = aligned ? "m" : component.frame.unit;
  if (aligned) {
    TopViewTrack truth;
    truth.label = "ground truth";
    truth.color = "#c9d0d8";
    truth.width = 6;
    truth.pieces = ProjectPieces(*ground_truth, plane);
    view.tracks.push_back(truth);
  }
  for (const int index : component.submaps) {
    const SnapshotSubmap& submap = snapshot.submaps[index];
    if (submap.frames.empty()) continue;
    const Trajectory frames = TransformTrajectory(ToTrajectory(submap.frames), view_from_root);
    TopViewTrack track;
    track.label = SubmapName(submap) + " (" + std::to_string(submap.frames.size()) + ")";
    track.tooltip = SubmapName(submap) + ": frames " + std::to_string(submap.frames.front().frame) + " to " +
                    std::to_string(submap.frames.back().frame);
    track.color = CategoryColor(submap.number);
    track.tag = std::to_string(submap.number);
    track.pieces = ProjectPieces(frames, plane);
    view.tracks.push_back(track);
    if (submap.Lost()) {
      view.marks.push_back({plane.Project(frames.back().world_from_camera.translation),
                            SubmapName(submap) + ": tracking lost after frame " +
                                std::to_string(submap.submap->last_frame) + ", " +
                                ReadableReason(submap.submap->end_reason)});
    }
  }
  view.mark_label = "tracking lost";
  if (options.here) view.here.push_back(plane.Project(view_from_root * *options.here));
  return TopViewSvg(view);
}

}  // namespace mapmend
