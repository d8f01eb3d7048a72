#pragma once

#include <Eigen/Core>
#include <array>
#include <string>
#include <vector>

namespace mapmend {

// An ideal pinhole camera, pixels: u = fx x/z + cx, v = fy y/z + cy. All features in mapmend are undistorted into one.
struct Pinhole {
  double fx = 0, fy = 0, cx = 0, cy = 0;
  int width = 0, height = 0;

  Eigen::Vector2d Project(const Eigen::Vector3d& x_cam) const {
    return {fx * x_cam.x() / x_cam.z() + cx, fy * x_cam.y() / x_cam.z() + cy};
  }
  // Ray with z = 1.
  Eigen::Vector3d Unproject(const Eigen::Vector2d& pixel) const {
    return {(pixel.x() - cx) / fx, (pixel.y() - cy) / fy, 1.0};
  }
};

// A real camera with lens distortion. The coefficients in Camera::distortion, by model:
//   pinhole             radial-tangential, OpenCV's model: k1 k2 p1 p2 k3
//   fisheye             Kannala-Brandt (J. Kannala, S. Brandt, PAMI 2006), OpenCV's fisheye model: k1 k2 k3 k4
//   rational            OpenCV's model of 14 coefficients: k1 k2 p1 p2 k3 k4 k5 k6 s1 s2 s3 s4 tauX tauY
//   fov                 one angle in radians (F. Devernay, O. Faugeras, MVA 2001): w
//   omni                unit sphere with a mirror parameter (C. Mei, P. Rives, ICRA 2007): xi k1 k2 p1 p2
//   double_sphere       two spheres (V. Usenko, N. Demmel, D. Cremers, 3DV 2018): xi alpha
//   extended_unified    (B. Khomutenko, G. Garcia, P. Martinet, RA-L 2016): alpha beta
//   thin_prism_fisheye  COLMAP's model: k1 k2 p1 p2 k3 k4 sx1 sy1
//   division            one coefficient (A. Fitzgibbon, CVPR 2001), ideal = distorted / (1 + l r^2): l
struct Camera {
  enum class Model {
    kPinhole,
    kFisheye,
    kRational,
    kFov,
    kOmni,
    kDoubleSphere,
    kExtendedUnified,
    kThinPrismFisheye,
    kDivision
  };
  static constexpr int kMaxCoefficients = 14;

  Model model = Model::kPinhole;
  int width = 0, height = 0;  // pixels; 0 if the file does not say
  double fx = 0, fy = 0, cx = 0, cy = 0;
  std::array<double, kMaxCoefficients> distortion = {};
  double fps = 0;  // 0 if the file does not say

  // Distorted pixel of a point in camera coordinates (z > 0).
  Eigen::Vector2d Project(const Eigen::Vector3d& x_cam) const;
  // The same camera for images scaled by factor (1 = unchanged).
  Camera Scaled(double factor) const;
  // The same for images of another size, by a factor for each axis.
  Camera Resized(int new_width, int new_height) const;
  // The ideal pinhole camera into which Undistort maps, as large in the middle as the real one: fx, fy, cx, cy, but for
  // models of spheres, whose focal lengths are in another unit.
  Pinhole Ideal() const;
  // Distorted pixels to pixels of Ideal(). Where the distortion is zero the pixels are returned as they are.
  //   seen  may be null; whether the pixel has a place in Ideal(), one for each: false where the lens model has no
  //         inverse (what comes out does not project back to within a pixel), and beyond 89 degrees from the axis
  std::vector<Eigen::Vector2f> Undistort(const std::vector<Eigen::Vector2f>& pixels,
                                         std::vector<bool>* seen = nullptr) const;
  bool HasDistortion() const;
  std::string ModelName() const;  // "pinhole", "fisheye", ... as above
  int NumCoefficients() const;    // of distortion that the model uses
};

// The model of that name, or false.
bool ParseCameraModel(const std::string& name, Camera::Model* model);

// The camera of a calibration file, in any of the formats of ReadCameraFile, which see.
Camera ReadCamera(const std::string& path);

}  // namespace mapmend
