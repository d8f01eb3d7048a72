#pragma once

#include <string>

#include "libs/connecting/connected_frames.h"
#include "libs/geometry/sim3_refinement.h"
#include "libs/optim/sim3_pose_graph.h"

// How well an edge of the connection graph holds together what it joins: what its evidence leaves open of the transform
// between two submaps, and how much that is where the submaps are far from each other.
namespace mapmend {

// What is left open of a transform b_from_a, by the d of Perturb.
//   information      J^T W J of its observations
//   median_error_px  of their reprojections: where they are worse than their own sigmas say, the transform is, too
Matrix7d TransformCovariance(const Matrix7d& information, double median_error_px);

// How exactly a transform relates two cameras, one standard deviation each.
//   center    of the camera, in the frame of a
//   depth     of the scene there, units of b
RelationSigmas SigmasAt(const Similarity3& b_from_a, const Matrix7d& covariance, const Eigen::Vector3d& center,
                        double depth);

struct FarEnd {
  double share = 0;  // one standard deviation of where it comes to lie, of the extent of its submap
  bool is_of_a = false;
};
// The end of a submap that the transform leaves open most. The extent of a submap is the diagonal of the box around its
// cameras, or the distance to what they see, if that is more.
FarEnd FindFarEnd(const Submap& a, const Submap& b, const Similarity3& b_from_a, const Matrix7d& covariance);

// For the reason of a connection; begins with kWeakReason.
std::string DescribeWeakness(const FarEnd& far_end);

}  // namespace mapmend
