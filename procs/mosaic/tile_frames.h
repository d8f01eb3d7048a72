#pragma once

#include <map>
#include <nlohmann/json_fwd.hpp>
#include <optional>
#include <string>
#include <vector>

#include "libs/base/range.h"
#include "libs/map_view/snapshot.h"
#include "libs/mosaic/tile_grid.h"
#include "libs/positioning/placement.h"

namespace mapmend {

struct TileFrameOptions {
  double max_shift_px = 25;    // a part of the map on the earth that belongs so far from where it is shown is moved
  double max_tilt_deg = 2;     // of a part that is not on the earth: beyond, it is levelled anew
  double max_coarser = 2.2;    // the finest tiles may be so much coarser or finer than the images
  double finest_gsd_m = 0.01;  // of tiles, metres
  int local_zoom = 20;         // the finest of maps that are not on the earth

  template <typename Visitor>
  void Visit(Visitor& v) {
    v("max_shift_px", max_shift_px, AtLeast(0), "pixels of tiles");
    v("max_tilt_deg", max_tilt_deg, Range(0, 90), "degrees");
    v("max_coarser", max_coarser, MoreThan(1));
    v("finest_gsd_m", finest_gsd_m, MoreThan(0), "m");
    v("local_zoom", local_zoom, Range(10, kMaxZoom));
  }
};

// A part of the map: a component of the snapshot.
struct MapPart {
  std::string name;                     // after its root
  std::vector<Eigen::Vector3d> points;  // root's frame
};
std::vector<MapPart> PartsOf(const Snapshot& snapshot);

// [west, south, east, north] in the units of the tiles.
nlohmann::json ToJson(const GroundBounds& bounds);

// Where the parts of a growing map lie on the tiles. What is only a little better than before is not taken over, since
// everything would have to be drawn again: on the earth a part stays where it is until it belongs elsewhere; without
// positions any frame will do whose z axis points up. Parts without a place of their own lie south of the main one, in
// a row, their pixels as large as its.
class TileFrames {
 public:
  // text: what ToText of an earlier run of this process said; empty, or of something else: nothing.
  explicit TileFrames(const TileFrameOptions& options, const std::string& text = "");

  struct Frame {
    bool is_on_earth = false;
    Similarity3 ground_from_root;
    GroundBounds bounds;  // of the ground that is seen from there, roughly
  };
  //   parts     as Snapshot::components
  //   world     null without positions
  //   is_fresh  whatever was before: a function of the map alone
  void Update(const Snapshot& snapshot, const std::vector<MapPart>& parts, const WorldPlacement* world, bool is_fresh);

  bool IsOnEarth() const { return is_on_earth_; }
  int Zoom() const { return zoom_; }
  const TilePlane& Plane() const { return plane_; }
  // By the part's name, as of the last update; null: it has none, since it shows nothing.
  const Frame* Find(const std::string& name) const;
  std::string ToText() const;

 private:
  using Frames = std::map<std::string, Frame>;
  struct Inputs;

  void Place(const Inputs& inputs, int component, Frames* before);
  std::optional<Frame> Fresh(const Inputs& inputs, int component) const;
  void ChoosePlane(const WorldPlacement& world, const GroundBounds& bounds, double gsd);
  bool IsGood(const Frame& frame, const Frame& fresh, const SnapshotComponent& component) const;
  void PlaceApart(Frame* frame) const;

  TileFrameOptions options_;
  bool is_on_earth_ = false;
  int zoom_ = 0;  // 0: none yet
  TilePlane plane_;
  std::string main_;
  Frames frames_;
};

}  // namespace mapmend
