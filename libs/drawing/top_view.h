#pragma once

#include <Eigen/Core>
#include <string>
#include <vector>

#include "libs/drawing/canvas.h"
#include "libs/geometry/trajectory_file.h"

// Trajectories seen from above.
namespace mapmend {

// From the world to a plane, seen from the side where the sky is: x to the right, y up, world units.
struct PlaneView {
  Eigen::Vector3d x_axis = Eigen::Vector3d::UnitX(), y_axis = Eigen::Vector3d::UnitY();
  Eigen::Vector2d Project(const Eigen::Vector3d& point) const { return {x_axis.dot(point), y_axis.dot(point)}; }
};

// The plane that fits the camera positions best, with the longest extent from left to right. Which side is up follows
// from how the cameras are held: pictures are taken upright or downwards. Where the cameras move along a line, that
// alone decides.
PlaneView DominantPlane(const Trajectory& trajectory);

// For ground truth whose axes mean something: x-y, unless z extends so much more than x or y that another pair of axes
// is the ground (street data sets have y down).
PlaneView GroundPlane(const Trajectory& ground_truth);

// The projected positions, cut where the time between neighbours exceeds gap_factor times the median.
std::vector<std::vector<Eigen::Vector2d>> ProjectPieces(const Trajectory& trajectory, const PlaneView& view,
                                                        double gap_factor = 10);

struct TopViewTrack {
  std::string label;    // in the legend
  std::string tooltip;  // more, shown when pointed at
  std::string color;
  double width = 2.5;
  bool dashed = false;
  std::string tag;  // short name at the start of the track; empty: the start is not marked
  std::vector<std::vector<Eigen::Vector2d>> pieces;
};

struct TopViewMark {
  Eigen::Vector2d at = Eigen::Vector2d::Zero();
  std::string tooltip;
};

struct TopView {
  std::string title, subtitle;
  std::string unit = "m";             // of all positions, for the scale
  std::vector<TopViewTrack> tracks;   // drawn in this order
  std::vector<TopViewMark> marks;     // red crosses
  std::string mark_label;             // of the crosses in the legend
  std::vector<Eigen::Vector2d> here;  // where the camera is now: at most one
};

// Size that DrawTopView wants for this view, pixels.
Eigen::Vector2d TopViewSize(const TopView& view);
void DrawTopView(const TopView& view, Canvas* canvas);
std::string TopViewSvg(const TopView& view);

// 1, 2 or 5 times a power of ten, the largest not above value (> 0).
double RoundStep(double value);

}  // namespace mapmend
