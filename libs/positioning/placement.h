#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "libs/base/range.h"
#include "libs/geometry/rigid3.h"
#include "libs/positioning/position_fix.h"
#include "libs/positioning/similarity_fit.h"
#include "libs/positioning/world_frame.h"

// Where the parts of a map lie on the earth.
namespace mapmend {

struct PlacementOptions {
  double sigma_horizontal_m = 2, sigma_vertical_m = 4;  // of fixes that tell none
  double sigma_angle_deg = 5;      // of how the camera was held, all fixes together: mounting, gimbal, compass
  double correlated_s = 10;        // the error of a receiver stays about the same for so long
  double max_clock_offset_s = 60;  // looked for on either side; clocks further apart do not overlap
  double min_gain = 0.15;          // an offset is taken only if the residuals become smaller by this share
  double max_residual = 0.25;      // of the extent, median: beyond, the positions are not of this flight

  template <typename Visitor>
  void Visit(Visitor& v) {
    v("sigma_horizontal_m", sigma_horizontal_m, MoreThan(0), "m");
    v("sigma_vertical_m", sigma_vertical_m, MoreThan(0), "m");
    v("sigma_angle_deg", sigma_angle_deg, MoreThan(0), "degrees");
    v("correlated_s", correlated_s, AtLeast(0), "s");
    v("max_clock_offset_s", max_clock_offset_s, Range(0, 86400), "s");
    v("min_gain", min_gain, Range(0, 1));
    v("max_residual", max_residual, MoreThan(0));
  }
};

// A frame of the map.
struct TrackPoint {
  int session = 0;
  int64_t utime = 0;
  Rigid3 cam_from_map;
};

// The fixes of one flight, ascending by time.
struct SessionFixes {
  std::vector<PositionFix> fixes;
};

// What the clocks of camera and receiver differ by: time of an image = time of a fix + offset.
struct ClockOffset {
  int64_t offset_us = 0;
  double sigma_s = 0;   // how well it is known; 0: not estimated
  std::string problem;  // why there is no fix for any frame, for a person
};

struct PlacementResidual {
  int session = 0;
  size_t fix = 0;                                      // index into its fixes
  int64_t utime = 0;                                   // of the camera's clock
  Eigen::Vector3d enu = Eigen::Vector3d::Zero();       // where the receiver was
  Eigen::Vector3d residual = Eigen::Vector3d::Zero();  // map minus receiver, metres
  double weight = 0;                                   // below a quarter: an outlier
};

// One part of the map.
struct Placement {
  bool success = false;
  std::string problem;            // why not, or what is not determined; for a person
  std::vector<std::string> open;  // freedoms that the fixes leave, in words
  Similarity3 enu_from_map;
  Matrix7 covariance = Matrix7::Zero();              // as in SimilarityFit, errors of the receiver correlated
  Eigen::Vector3d center = Eigen::Vector3d::Zero();  // what it is about, ENU
  std::vector<PlacementResidual> residuals;
  double median_horizontal_m = 0, rms_horizontal_m = 0, median_vertical_m = 0;  // of all residuals; rms: of inliers
  int num_outliers = 0;

  double SigmaHorizontal() const;  // metres, at the centre
  double SigmaVertical() const;
  double SigmaHeadingDeg() const;
  double SigmaTiltDeg() const;
  double SigmaScale() const;  // relative
};

struct WorldPlacement {
  LocalFrame frame{Geodetic()};       // origin: the first fix
  std::vector<Placement> components;  // as given
  std::vector<ClockOffset> clocks;    // per session
  std::string problem;                // why nothing is placed; empty if something is
};

//   components  frames of each part, ascending by time
//   sessions    by TrackPoint::session
WorldPlacement PlaceComponents(const std::vector<std::vector<TrackPoint>>& components,
                               const std::vector<SessionFixes>& sessions, const PlacementOptions& options);

// Rotation enu_from_camera of a camera held at these angles (PositionFix).
Eigen::Quaterniond CameraRotation(double yaw_deg, double pitch_deg, double roll_deg);

}  // namespace mapmend
