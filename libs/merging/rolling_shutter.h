#pragma once

#include <Eigen/Core>
#include <vector>

#include "libs/geometry/camera.h"
#include "libs/stream/submap.h"

// Most cameras read an image line by line while they move; what a line shows is where the camera was then. Lines are
// rows of the image, or columns if the camera was turned (a phone held upright). A pose is that of the middle line.
// With t the readout time of the whole image, a line at place h (-0.5 top or left, 0.5 bottom or right) is read t h
// seconds from it, and a point at x in the camera frame moves by -(v + w x x) a second. To first order its pixel is off
// by that, projected (M. Meingast, C. Geyer, S. Sastry: Geometric models of rolling-shutter cameras, OMNIVIS 2005).
namespace mapmend {

enum class ScanLines { kRows, kColumns };

struct Shutter {
  double readout = 0;  // seconds, from the first line to the last; 0: all at once; negative: the last line first
  ScanLines lines = ScanLines::kRows;
};

// How a camera moves, in its own frame.
struct CameraMotion {
  Eigen::Vector3d velocity = Eigen::Vector3d::Zero();   // submap units per second
  Eigen::Vector3d turn_rate = Eigen::Vector3d::Zero();  // radians per second
};

// The motion at each keyframe of the submap, in their order, from the frames tracked before and after it, up to two
// each. Frames further away in time than three times what is usual in the submap say nothing; a keyframe without any is
// at rest.
std::vector<CameraMotion> KeyframeMotions(const Submap& submap);

// Place of the line in which a pixel of the ideal camera was read, -0.5 to 0.5. real: the camera as it is, with
// distortion; without a size the ideal one.
double LinePlace(const Pinhole& ideal, const Camera& real, const Eigen::Vector2d& pixel, ScanLines lines);

// Pixels per second of readout time to add to a pixel in the line at this place to get where it would be if all lines
// had been read at once. x_cam: where the point is, in submap units; behind the camera nothing is
// corrected.
Eigen::Vector2d ShutterCorrection(const Pinhole& camera, const CameraMotion& motion, const Eigen::Vector3d& x_cam,
                                  double line_place);

}  // namespace mapmend
