#pragma once

#include <vector>

#include "libs/base/range.h"
#include "libs/connecting/local_window.h"
#include "libs/features/matching.h"
#include "libs/geometry/similarity3.h"

namespace mapmend {

// In-plane turn (radians) of an image when its camera is rotated by target_from_source.
double InPlaneTurn(const Eigen::Matrix3d& target_from_source);
double WrapAngle(double angle);  // into [-pi, pi)

// A map point with what is needed to recognise it in another image.
struct PointAppearance {
  MapPointId id;
  Eigen::Vector3d position;  // frame of its owner
  Descriptor descriptor;
  int octave = 0;
  float angle = 0;  // keypoint orientation in the source keyframe
  double size = 0;  // Scale(octave) * depth / f of the source keyframe: patch size in units of the owner's frame
  int source = -1;  // index of the source keyframe, chosen by the caller
};

// What one keyframe (index `source`) knows of the map points it observes.
void AppendAppearances(const SubmapView& view, const SubmapKeyframe& keyframe, int source,
                       std::vector<PointAppearance>* appearances);

struct ProjectionSearchOptions {
  double radius = 10;     // pixels at octave 0; grows with the predicted octave
  int max_distance = 64;  // bits
  double ratio = 0.9;
  int octave_tolerance = 2;
  double max_turn = 0.52;  // radians, orientation against prediction; pi: off
  double border = 0;       // pixels outside the image still counted as visible

  template <typename Visitor>
  void Visit(Visitor& v) {
    v("radius", radius, MoreThan(0), "pixels at octave 0");
    v("max_distance", max_distance, Range(0, 256), "bits");
    v("ratio", ratio, Range(0, 1));
    v("octave_tolerance", octave_tolerance, Range(0, 31), "octaves");
    v("max_turn", max_turn, Range(0, 3.2), "radians");
    v("border", border, AtLeast(0), "pixels");
  }
};

struct ProjectionMatch {
  int appearance = -1;  // index
  int feature = -1;     // of the target keyframe
  int distance = 256;
};

struct ProjectionMatches {
  std::vector<ProjectionMatch> matches;  // at most one per feature and per appearance
  int num_visible = 0;    // points predicted inside the image at an octave of the pyramid, give or take one
  int num_reachable = 0;  // features in those parts of the image, at octaves searched there
};

// Finds map points in a keyframe in which they are predicted: projection, octave and orientation must fit, then the
// descriptor. cam_from_owner takes owner's points (similarity: the target's camera units) into the target camera;
// source_rotations[i] is the rotation cam_from_owner of source keyframe i, for the predicted orientation.
ProjectionMatches FindByProjection(const std::vector<PointAppearance>& appearances,
                                   const std::vector<Eigen::Quaterniond>& source_rotations,
                                   const Similarity3& cam_from_owner, const Pinhole& camera, const Pyramid& pyramid,
                                   const std::vector<Keypoint>& keypoints, const std::vector<Descriptor>& descriptors,
                                   const FeatureGrid& grid, const ProjectionSearchOptions& options);

}  // namespace mapmend
