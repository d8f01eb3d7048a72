#include "libs/connecting/seam.h"

#include <gtest/gtest.h>

#include "libs/connecting/connection.h"
#include "tests/merger_fixture.h"

namespace mapmend {
namespace seam_test {

using testing::Frame;
using testing::Strip;
using testing::SyntheticFlight;

Submap Row(double length, int count) {
  Submap submap;
  for (int i = 0; i < count; ++i) {
    SubmapKeyframe& keyframe = submap.keyframes[KeyframeId(i)];
    keyframe.id = KeyframeId(i);
    keyframe.cam_from_submap.translation = -Eigen::Vector3d(length * i / (count - 1), 0, 0);
  }
  return submap;
}

Matrix7d InformationOf(const Vector7d& sigmas) { return sigmas.cwiseAbs2().cwiseInverse().asDiagonal(); }

TEST(TransformCovariance, IsTheInverseAndGrowsWithErrorsThatSigmasDoNotExplain) {
  const Vector7d sigmas = (Vector7d() << 0.01, 0.02, 0.01, 0.3, 0.2, 0.1, 0.05).finished();
  const Matrix7d exact = TransformCovariance(InformationOf(sigmas), 0.5);
  EXPECT_LT((exact.diagonal().cwiseSqrt() - sigmas).norm(), 1e-9);
  const Matrix7d worse = TransformCovariance(InformationOf(sigmas), 2 * 1.18);
  EXPECT_LT((worse.diagonal().cwiseSqrt() - 2 * sigmas).norm(), 1e-9);
}

TEST(TransformCovariance, WhatNoObservationTellsIsLeftOpen) {
  Matrix7d information = InformationOf(Vector7d::Constant(0.01));
  information(6, 6) = 0;
  EXPECT_GT(TransformCovariance(information, 0)(6, 6), 1e6);
}

TEST(FarEnd, IsWhereTheScaleThatIsLeftOpenMovesMost) {
  // A transform that is known at the origin of a but for its scale, to a hundredth.
  const Submap a = Row(10, 11), b = Row(4, 5);
  Vector7d sigmas = Vector7d::Constant(1e-6);
  sigmas(6) = 0.01;
  const FarEnd of_a = FindFarEnd(a, b, Similarity3(), TransformCovariance(InformationOf(sigmas), 0));
  EXPECT_NEAR(of_a.share, 0.01, 1e-4);
  // The younger submap lies far from that place.
  const Similarity3 b_from_a(2, Eigen::Quaterniond::Identity(), {-100, 0, 0});
  const FarEnd of_b = FindFarEnd(a, b, b_from_a, TransformCovariance(InformationOf(sigmas), 0));
  EXPECT_FALSE(of_b.is_of_a);
  EXPECT_NEAR(of_b.share, 0.01 * 104 / 4, 1e-4);
}

TEST(Seam, SigmasAreThoseOfTheCamera) {
  Vector7d sigmas = Vector7d::Constant(1e-6);
  sigmas.head<3>().setConstant(0.01);
  sigmas(6) = 0.02;
  const Matrix7d covariance = TransformCovariance(InformationOf(sigmas), 0);
  const RelationSigmas near = SigmasAt(Similarity3(), covariance, {0, 0, 0}, 5);
  EXPECT_NEAR(near.rotation, 0.01, 1e-4);
  EXPECT_NEAR(near.scale, 0.02, 1e-4);
  EXPECT_NEAR(near.translation, 0, 1e-4);
  const RelationSigmas far = SigmasAt(Similarity3(), covariance, {10, 0, 0}, 5);
  // By turns about two axes, and by the scale along the third.
  EXPECT_NEAR(far.translation, std::sqrt((2 * 0.1 * 0.1 + 0.2 * 0.2) / 3) / 5, 1e-4);
}

// Two strips that cross, connected by what some pairs of keyframes see in common.
class Crossing {
 public:
  Crossing() : flight_("s", 0, testing::Terrain(), {}) {
    std::mt19937_64 random(91);
    flight_.AddSubmap(Strip({40, 100}, {340, 100}, 100, 11, 90, &random), Frame(0.02, 0.3));
    flight_.AddSubmap(Strip({60, 60}, {60, 340}, 100, 11, 0, &random), Frame(0.05, -0.9));
    flight_.End();
    session_ = flight_.Model();
    a_ = {&session_.submaps.at(SubmapId(0)), session_.info.pinhole, session_.info.pyramid};
    b_ = {&session_.submaps.at(SubmapId(1)), session_.info.pinhole, session_.info.pyramid};
    for (const auto& [ka, keyframe_a] : a_.submap->keyframes) {
      for (const auto& [kb, keyframe_b] : b_.submap->keyframes) {
        ConnectedFrames frames = VerifyConnectedFrames(a_, ka, b_, kb, {});
        if (frames.success) evidence_.push_back(std::move(frames));
      }
    }
  }

  // most: common points of each pair that are used
  Connection Estimate(size_t num_pairs, size_t most) const {
    Connection connection;
    for (const ConnectedFrames& frames : evidence_) {
      if (connection.evidence.size() == num_pairs) break;
      ConnectedFrames& few = connection.evidence.emplace_back(frames);
      few.a_in_b.resize(std::min(few.a_in_b.size(), most));
      few.b_in_a.resize(std::min(few.b_in_a.size(), most));
    }
    EstimateConnection(a_, b_, {}, &connection);
    return connection;
  }
  FarEnd FarEndOf(const Connection& c) const {
    return FindFarEnd(*a_.submap, *b_.submap, c.b_from_a, TransformCovariance(c.information, c.median_error_px));
  }
  // The far end of the older strip, of its extent.
  double TrueError(const Connection& c) const {
    const Similarity3 truth = flight_.submap_from_world()[1] * flight_.submap_from_world()[0].Inverse();
    const Eigen::Vector3d begin = a_.submap->keyframes.begin()->second.cam_from_submap.Center(),
                          end = a_.submap->keyframes.rbegin()->second.cam_from_submap.Center();
    return (c.b_from_a * end - truth * end).norm() / (truth.scale * (end - begin).norm());
  }

 private:
  SyntheticFlight flight_;
  Session session_;
  SubmapView a_, b_;
  std::vector<ConnectedFrames> evidence_;
};

TEST(Seam, AConnectionOfFewPointsIsToldAsWeakAndOneOfManyIsNot) {
  const Crossing crossing;
  const Connection many = crossing.Estimate(100, 1000), few = crossing.Estimate(1, 4);
  ASSERT_EQ(many.verdict, Connection::Verdict::kAccepted) << many.reason;
  ASSERT_EQ(few.verdict, Connection::Verdict::kAccepted) << few.reason;
  EXPECT_FALSE(IsWeak(many)) << many.reason;
  EXPECT_TRUE(IsWeak(few)) << few.reason;
  EXPECT_NE(few.reason.find("far end of the older submap"), std::string::npos) << few.reason;
  // What is told is what is true, roughly.
  for (const Connection* c : {&many, &few}) {
    EXPECT_LT(crossing.TrueError(*c), 4 * crossing.FarEndOf(*c).share + 0.002);
    EXPECT_GT(crossing.FarEndOf(*c).share, 0);
  }
}

}  // namespace seam_test
}  // namespace mapmend
