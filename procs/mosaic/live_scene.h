#pragma once

#include <optional>
#include <set>
#include <string>
#include <utility>
#include <vector>

#include "libs/base/range.h"
#include "libs/map_view/shutters.h"
#include "libs/map_view/world.h"
#include "libs/mosaic/tile_recipe.h"
#include "procs/mosaic/known_images.h"
#include "procs/mosaic/live_exposure.h"
#include "procs/mosaic/tile_frames.h"

namespace mapmend {

struct LiveSceneOptions {
  PlacementOptions placement;
  TileFrameOptions frames;
  GroundSceneOptions ground;
  ExposureOptions exposure;

  template <typename Visitor>
  void Visit(Visitor& v) {
    v("placement", placement);
    v("frames", frames);
    ground.Visit(v);
    v("exposure", exposure);
  }
};

// From the map as it stands to what the tiles show.
class LiveScene {
 public:
  //   frames  as metadata of an earlier run have it (Metadata), or empty
  LiveScene(const LiveSceneOptions& options, const std::string& frames);

  // is_final: as a function of the map and the images alone, whatever was before.
  TileScene Make(const Snapshot& snapshot, const KnownImages& images, bool is_final);
  // Of the last scene: where the newest keyframe is, on the ground.
  const Eigen::Vector2d& Focus() const { return focus_; }
  // Why the main part is not shown; empty if it is.
  const std::string& Problem() const { return problem_; }
  // What the file of tiles says of itself (docs/mosaic.md), by name.
  std::map<std::string, std::string> Metadata(const TileScene& scene) const;

 private:
  std::optional<TileComponent> MakeComponent(const Snapshot& snapshot, int component, const MapPart& part,
                                             const KnownImages& images, bool is_final);

  std::map<std::string, FoundShutter> shutters_;  // of a final map only
  const LiveSceneOptions options_;
  TileFrames frames_;
  LiveExposure exposure_;
  std::set<std::pair<std::string, int>> leading_;  // part, image: GroundScene::IsLeading so far
  Eigen::Vector2d focus_ = Eigen::Vector2d::Zero();
  std::string problem_;
};

}  // namespace mapmend
