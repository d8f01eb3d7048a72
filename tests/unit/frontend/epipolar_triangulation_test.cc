#include "procs/frontend/epipolar_triangulation.h"

#include <gtest/gtest.h>

#include <cmath>
#include <memory>

#include "libs/base/random.h"
#include "tests/unit/frontend/sparse_flight.h"

namespace mapmend {
namespace epipolar_triangulation_test {

// Each second feature of the first photo looks exactly like something elsewhere in the second one, and nearly like its
// true match there. Along the epipolar line only the true one lies; in a field of thousands of features that look alike
// it might as well be a wrong one.
class AlikeElsewhere : public testing::Test {
 protected:
  AlikeElsewhere() {
    const Rigid3 pose_a = NadirPose(0, 0), pose_b = NadirPose(SparseFlight::kStep, 0);
    const FramePtr a = flight_.Photo(pose_a, 0);
    auto b = std::make_shared<Frame>(*flight_.Photo(pose_b, 1));
    Random random(1);
    for (int i = 0; i < a->features.Size(); i += 2) {
      Keypoint elsewhere = a->features.keypoints[i];
      elsewhere.pixel = {static_cast<float>(800 * random.Uniform()), std::fmod(elsewhere.pixel.y() + 200, 600.0F)};
      b->features.keypoints.push_back(elsewhere);
      b->features.descriptors.push_back(a->features.descriptors[i]);
    }
    b->grid = FeatureGrid(b->features.keypoints, 800, 600);
    for (const bool are_photos : {false, true}) {
      WorkingMap map(SubmapId(0), {}, &ids_);
      const auto kept = [&](const Frame& frame) {
        auto copy = std::make_shared<Frame>(frame);
        if (!are_photos) copy->photo = nullptr;
        return copy;
      };
      map.AddKeyframe(kept(*a), pose_a);
      map.AddKeyframe(kept(*b), pose_b);
      const EpipolarTriangulation triangulation({}, flight_.Camera(), {});
      found_[are_photos] =
          triangulation.FindPoints(map.Keyframe(KeyframeIndex(0)), map.Keyframe(KeyframeIndex(1)), {0.5, 2});
    }
  }
  // Of features that have a rival elsewhere.
  int CountWithRival(const std::vector<NewPoint>& points) const {
    int count = 0;
    for (const NewPoint& p : points) count += p.feature_a % 2 == 0;
    return count;
  }

  SparseFlight flight_{1};
  IdSource ids_;
  std::vector<NewPoint> found_[2];
};

TEST_F(AlikeElsewhere, CountsInPhotosOnly) {
  EXPECT_GT(CountWithRival(found_[false]), 100);
  EXPECT_EQ(CountWithRival(found_[true]), 0);
}

TEST_F(AlikeElsewhere, LeavesTheOthersOnTheGround) {
  ASSERT_GT(found_[true].size(), 100u);
  for (const NewPoint& p : found_[true]) EXPECT_NEAR(p.position.z(), 0, 0.03);
}

}  // namespace epipolar_triangulation_test
}  // namespace mapmend
