#pragma once

#include <chrono>
#include <string>

#include "libs/map_view/map_model.h"
#include "libs/map_view/world.h"
#include "procs/viewer_export/coverage.h"
#include "procs/viewer_export/live_feed.h"

namespace mapmend {

struct OverviewOptions {
  PlacementOptions placement;
  CoverageOptions coverage;
  std::string files;  // folder of results, where a picture of the ground may lie; empty: none
  // At most one part in so many of the time goes into it.
  int pause_share = 150;
  std::chrono::milliseconds min_pause{2000};
};

// What the page shows that takes a look at the whole map, so the less often the larger the map is: figures,
// restoration, gaps, frame/KEY (which way is up in the part whose root is KEY), mosaic (docs/protocol.md, The live
// page).
class LiveOverview {
 public:
  explicit LiveOverview(const OverviewOptions& options) : options_(options) {}
  // Works all out anew if the map has changed and enough time has passed. is_final: nothing will change any more.
  void Publish(const MapModel& model, bool is_final, LiveFeed* feed);
  // The stacks L1 and L2 (restoration.h), as of the last time.
  const std::string& Stacks() const { return stacks_; }

 private:
  using Clock = std::chrono::steady_clock;

  void PublishMosaic(const MapModel& model, LiveFeed* feed);

  const OverviewOptions options_;
  int64_t version_ = -1;  // of the model
  bool was_final_ = false;
  Clock::time_point next_, next_mosaic_;
  std::string stacks_;
  Similarity3 main_frame_;  // page from root, of the main part
  std::string mosaic_;      // of which picture the value "mosaic" tells
};

}  // namespace mapmend
