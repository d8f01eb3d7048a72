#pragma once

#include <string>
#include <vector>

#include "libs/base/range.h"
#include "libs/geometry/camera.h"
#include "libs/geometry/rigid3.h"
#include "libs/mosaic/exposure.h"
#include "libs/mosaic/ground_surface.h"
#include "libs/mosaic/ground_view.h"

namespace mapmend {

struct GroundSceneOptions {
  GroundSurfaceOptions surface;
  double max_tilt_deg = 60;  // of the optical axes' median from straight down; beyond, it is not the ground
  double max_relief = 0.5;   // of the height above the ground: median distance of points from the surface
  // Of images that lie closer together than this, of the shorter side of the ground that they show, and look alike, one
  // leads. 0: all do.
  double spacing = 0.2;

  template <typename Visitor>
  void Visit(Visitor& v) {
    v("surface", surface);
    v("max_tilt_deg", max_tilt_deg, Range(0, 90), "degrees");
    v("max_relief", max_relief, MoreThan(0), "of the height above the ground");
    v("spacing", spacing, Range(0, 1), "of the shorter side of an image on the ground");
  }
};

struct MosaicImage {
  Camera camera;
  Rigid3 cam_from_ground;  // z of the ground's frame points up
  ReadoutMotion motion = {};
  int id = -1;               // by which an ImageCache knows it; -1: its index
  bool was_leading = false;  // in an earlier scene, which decides between neighbours: so that little changes
};

// The ground, and the images that show it: all that a picture of it is made from, but for the pixels.
class GroundScene {
 public:
  // points: of the map, in the ground's frame.
  GroundScene(const GroundSceneOptions& options, std::vector<MosaicImage> images,
              const std::vector<Eigen::Vector3d>& points);

  // Empty, or one sentence why these images are no picture of the ground; then there is no surface.
  const std::string& Problem() const { return problem_; }
  const GroundSurface& Surface() const { return surface_; }
  int NumImages() const { return static_cast<int>(images_.size()); }
  const MosaicImage& Image(int image) const { return images_[static_cast<size_t>(image)]; }
  const GroundView& View(int image) const { return views_[static_cast<size_t>(image)]; }
  // A flight that takes many images of each place needs few of them: others than the leading ones count for little, so
  // that they show only what no leading one shows but with its border.
  bool IsLeading(int image) const { return is_leading_[static_cast<size_t>(image)]; }
  double Weight(int image) const {
    return is_set_aside_[static_cast<size_t>(image)] ? kWeightSetAside : IsLeading(image) ? 1 : kWeightBesideLeading;
  }
  static constexpr double kWeightBesideLeading = 0.3;
  // An image that shows next to nothing is seen only where no other one shows the ground; it does not lead any more.
  void SetAside(int image) {
    is_set_aside_[static_cast<size_t>(image)] = true;
    is_leading_[static_cast<size_t>(image)] = false;
  }
  static constexpr double kWeightSetAside = 0.001;
  // Around all that the image shows.
  const GroundBounds& Footprint(int image) const { return footprints_[static_cast<size_t>(image)]; }
  // Around the footprints of all images that are not excluded.
  GroundBounds Bounds() const;
  // Median size of the images' pixels on the ground; that of one of them.
  double Gsd() const;
  double Gsd(int image) const { return gsds_[static_cast<size_t>(image)]; }
  // Those whose footprints touch the bounds, ascending, without the excluded ones.
  std::vector<int> Near(const GroundBounds& bounds) const;
  Eigen::Vector3d OnSurface(const Eigen::Vector2d& place) const {
    return {place.x(), place.y(), surface_.Height(place.x(), place.y())};
  }

  // An image that is not to be had, or not to be used.
  void Exclude(int image) { excluded_[static_cast<size_t>(image)] = true; }
  // The image is used in another size, as if the camera had taken it so: share of what it is.
  void Reduce(int image, double share);
  const Exposure& GetExposure() const { return exposure_; }
  void SetExposure(Exposure exposure) { exposure_ = std::move(exposure); }

 private:
  void MakeViews();
  void ChooseLeading();
  bool IsBeside(int image, int other) const;
  void FitSurface(const std::vector<Eigen::Vector3d>& points);

  GroundSceneOptions options_;
  std::vector<MosaicImage> images_;
  std::vector<GroundView> views_;
  std::vector<GroundBounds> footprints_;
  std::vector<double> gsds_;
  std::vector<bool> excluded_, is_leading_, is_set_aside_;
  std::string problem_;
  GroundSurface surface_;
  Exposure exposure_;
};

// Whether a place lies inside, its border included.
bool Contains(const GroundBounds& bounds, const Eigen::Vector2d& place);
// The smallest bounds around some places; empty bounds without any.
GroundBounds BoundsOf(const std::vector<Eigen::Vector2d>& places);

}  // namespace mapmend
