#include "procs/frontend/sparse_beginning.h"

#include <gtest/gtest.h>

#include "libs/base/median.h"
#include "tests/unit/frontend/sparse_flight.h"

namespace mapmend {
namespace sparse_beginning_test {

bool IsMotion(const Rigid3& found, const Rigid3& first, const Rigid3& second) {
  const Rigid3 truth = second * first.Inverse();
  return RotationAngle(found.rotation * truth.rotation.conjugate()) < 0.01 &&
         found.translation.normalized().dot(truth.translation.normalized()) > 0.999;
}

// The ambiguity of the plane: this is why two photos are not enough.
TEST(SparseBeginning, TwoMotionsExplainTwoPhotosOfAPlane) {
  SparseFlight flight(1);
  const Rigid3 a = flight.Pose(0, 0), b = flight.Pose(SparseFlight::kStep, 0);
  const PhotoPair pair = PairOf(flight.Photo(a, 0), flight.Photo(b, 1), {}, flight.Camera(), {});
  ASSERT_GE(pair.motions.size(), 2u);
  EXPECT_GT(static_cast<double>(pair.motions[1].Support()), 0.5 * static_cast<double>(pair.motions[0].Support()));
  int num_true = 0;
  for (const TwoViewCandidate& m : pair.motions) num_true += IsMotion(m.second_from_first, a, b);
  EXPECT_EQ(num_true, 1);
}

TEST(SparseBeginning, AThirdPhotoTellsWhichMotionIsTrue) {
  for (uint64_t seed = 1; seed <= 10; ++seed) {
    SparseFlight flight(seed);
    SparseBeginning beginning({}, flight.Camera(), {});
    std::vector<Rigid3> poses;
    Initialization found;
    for (int i = 0; i < 3; ++i) {
      EXPECT_FALSE(found.success) << "two photos are not enough";
      poses.push_back(flight.Pose(SparseFlight::kStep * i, 0));
      found = beginning.AddFrame(flight.Photo(poses.back(), i));
    }
    ASSERT_TRUE(found.success) << seed;
    EXPECT_EQ(found.first->index, 0);
    EXPECT_EQ(found.second->index, 1);
    EXPECT_TRUE(IsMotion(found.second_from_first, poses[0], poses[1])) << seed;
    std::vector<double> depths;
    for (const InitialPoint& p : found.points) depths.push_back(p.position.z());
    EXPECT_NEAR(Median(depths), 1, 1e-9);
  }
}

// Each overlaps with the next one, but no ground is seen in all three.
TEST(SparseBeginning, ThreePhotosWithNothingInCommonBeginNothing) {
  SparseFlight flight(2);
  SparseBeginning beginning({}, flight.Camera(), {});
  for (int i = 0; i < 3; ++i) EXPECT_FALSE(beginning.AddFrame(flight.Photo(flight.Pose(0.95 * i, 0), i)).success) << i;
}

TEST(SparseBeginning, AThirdPhotoOfAnotherPlaceBeginsNothing) {
  SparseFlight flight(3);
  SparseBeginning beginning({}, flight.Camera(), {});
  beginning.AddFrame(flight.Photo(flight.Pose(0, 0), 0));
  beginning.AddFrame(flight.Photo(flight.Pose(SparseFlight::kStep, 0), 1));
  const Initialization none = beginning.AddFrame(flight.Photo(flight.Pose(5, 5), 2));
  EXPECT_FALSE(none.success);
  EXPECT_EQ(none.reason, LossReason::kTooFewMatches);
}

TEST(SparseBeginning, AMistakeIsNotMadeAgain) {
  SparseFlight flight(4);
  SparseBeginning beginning({}, flight.Camera(), {});
  Initialization found;
  for (int i = 0; i < 3; ++i) found = beginning.AddFrame(flight.Photo(flight.Pose(SparseFlight::kStep * i, 0), i));
  ASSERT_TRUE(found.success);
  beginning.NoteMistake(found.first, found.second);
  found = beginning.AddFrame(flight.Photo(flight.Pose(3 * SparseFlight::kStep, 0), 3));
  ASSERT_TRUE(found.success);
  EXPECT_EQ(found.first->index, 1) << "the next two";
  EXPECT_EQ(found.second->index, 2);
}

}  // namespace sparse_beginning_test
}  // namespace mapmend
