#pragma once

#include <string>
#include <vector>

#include "libs/map_view/map_model.h"

namespace mapmend {

// A flight whose every pose and point is known, as the records a frontend would publish and the map a merger would
// make.
struct TestFlightOptions {
  std::string session = "11111111-2222-3333-4444-555555555555";
  int num_submaps = 2;
  int frames_per_submap = 20;
  int keyframe_every = 4;
  bool last_ends_with_loss = false;
};

// The camera flies parallel strips 50 m above flat ground and looks straight down. Submap i has its own frame and scale
// (i + 1 submap units are 10 m); there are missing frames between submaps. Points lie on the ground on a 10 m grid.
class TestFlight {
 public:
  explicit TestFlight(const TestFlightOptions& options = {});

  const std::vector<Record>& Records() const { return records_; }
  // True camera pose of a frame, metres.
  Rigid3 WorldFromCamera(int frame) const;
  Similarity3 WorldFromSubmap(int submap) const;
  static int64_t Utime(int frame) { return 1700000000000000 + frame * 100000LL; }
  // First frame of a submap: 5 frames are missing before each but the first.
  int FirstFrame(int submap) const { return submap * (options_.frames_per_submap + 5); }
  SubmapKey Key(int submap) const { return {options_.session, SubmapId(submap)}; }

  // All submaps in one component with root 0, joined in a chain, with further connections of every verdict.
  MapRevision Revision() const;
  // The refinement that moves nothing: poses and points as they are, in the root frame.
  RefinedSubmap Refinement(int submap) const;

 private:
  void Add(int64_t utime, RecordBody body);
  void AddSubmap(int submap);

  TestFlightOptions options_;
  std::vector<Record> records_;
  std::vector<std::vector<Eigen::Vector3d>> points_;  // per submap, world frame
  int next_keyframe_ = 0, next_point_ = 0;
};

// The model after all records (which must all be accepted).
MapModel MakeModel(const TestFlight& flight);

}  // namespace mapmend
