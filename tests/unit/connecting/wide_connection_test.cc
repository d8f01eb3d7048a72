#include "libs/connecting/wide_connection.h"

#include <gtest/gtest.h>

#include "tests/unit/connecting/wide_world.h"

namespace mapmend {
namespace wide_connection_test {

using testing::WidePoint;

const Similarity3 kAFromWorld(0.4, Eigen::Quaterniond(0.9, 0.1, -0.3, 0.2), {3, -1, 2});
const Similarity3 kBFromWorld(2.5, Eigen::Quaterniond(0.8, -0.2, 0.4, 0.3), {-7, 2, 1});

// Eight frames, 1.2 m apart.
std::vector<Rigid3> Drive(double from, double yaw = 0.02) {
  std::vector<Rigid3> cameras;
  for (int i = 0; i < 8; ++i) cameras.push_back(testing::StreetPose(0.05 * i, from + 1.2 * i, yaw * i));
  return cameras;
}

class WideConnectionTest : public ::testing::Test {
 protected:
  WideSide See(const std::vector<WidePoint>& points, const std::vector<Rigid3>& cameras, const Similarity3& frame,
               double first_s) {
    return testing::SeeStreet(points, cameras, frame, first_s, world_, &random_, &submap_);
  }
  // Where the transform puts a's last camera against where it is, metres.
  static double Error(const Similarity3& b_from_a, const WideSide& a) {
    const Eigen::Vector3d center = a.frames.back().cam_from_submap.Center();
    return (kBFromWorld.Inverse() * (b_from_a * center) - kAFromWorld.Inverse() * center).norm();
  }

  Random random_{5};
  testing::WideWorldOptions world_;
  Submap submap_;
};

TEST_F(WideConnectionTest, TracksArePointsWhereTheyAre) {
  const std::vector<WidePoint> street = testing::MakeStreet(0, 120, 1500, &random_);
  const WideSide side = See(street, Drive(0), kAFromWorld, 0);
  int num_points = 0, num_near = 0;
  for (const WideTrack& t : side.tracks) {
    if (!t.has_point) continue;
    ++num_points;
    const Eigen::Vector3d world = kAFromWorld.Inverse() * t.point;
    num_near += std::any_of(street.begin(), street.end(), [&](const WidePoint& p) {
      const Eigen::Vector3d e = kAFromWorld.rotation * (0.4 * (world - p.position));
      return e.dot(t.covariance.inverse() * e) < 16;
    });
  }
  EXPECT_GT(num_points, 400);
  EXPECT_GT(num_near, 0.97 * num_points) << "within four of their standard deviations";
}

TEST_F(WideConnectionTest, AGapInAStreetIsBridged) {
  const std::vector<WidePoint> street = testing::MakeStreet(0, 160, 3000, &random_);
  const WideSide a = See(street, Drive(0), kAFromWorld, 0), b = See(street, Drive(40), kBFromWorld, 4);
  const WideConnection connection = VerifyWideConnection(a, b, 3.3, {});
  ASSERT_TRUE(connection.success) << connection.reason;
  EXPECT_LT(Error(connection.frames[0].b_from_a, a), 0.3) << connection.reason;
  EXPECT_NEAR(connection.frames[0].b_from_a.scale, 2.5 / 0.4, 0.02 * 2.5 / 0.4);
  EXPECT_GE(connection.frames.size(), 5u);
  // The error is what the uncertainty says.
  const Matrix7d covariance = connection.frames[0].information.inverse();
  const Vector7d d = Difference(connection.frames[0].b_from_a, kBFromWorld * kAFromWorld.Inverse());
  EXPECT_LT(d.dot(covariance.inverse() * d), 40) << "7 degrees of freedom";
}

TEST_F(WideConnectionTest, TheSameSidesGiveTheSameBits) {
  const std::vector<WidePoint> street = testing::MakeStreet(0, 120, 2000, &random_);
  const WideSide a = See(street, Drive(0), kAFromWorld, 0), b = See(street, Drive(25), kBFromWorld, 3);
  const WideConnection first = VerifyWideConnection(a, b, 2, {}), second = VerifyWideConnection(a, b, 2, {});
  ASSERT_TRUE(first.success) << first.reason;
  EXPECT_EQ(ToArray(first.frames[0].b_from_a), ToArray(second.frames[0].b_from_a));
  EXPECT_EQ(first.reason, second.reason);
}

TEST_F(WideConnectionTest, OtherStreetsAreRefused) {
  for (int i = 0; i < 5; ++i) {
    const std::vector<WidePoint> one = testing::MakeStreet(0, 120, 2000, &random_),
                                 other = testing::MakeStreet(0, 120, 2000, &random_);
    const WideSide a = See(one, Drive(0), kAFromWorld, 0), b = See(other, Drive(20), kBFromWorld, 3);
    const WideConnection connection = VerifyWideConnection(a, b, -1, {});
    EXPECT_FALSE(connection.success) << connection.reason;
    ASSERT_EQ(connection.frames.size(), 1u);
    EXPECT_FALSE(connection.frames[0].success);
  }
}

// Behind the gap stands the same facade as before it, 30 m further: nothing in the images tells the one from the other.
TEST_F(WideConnectionTest, ARepeatedFacadeIsRefused) {
  const std::vector<WidePoint> street = testing::RepeatStreet(testing::MakeStreet(0, 12, 300, &random_), 12, 12);
  const WideSide a = See(street, Drive(0), kAFromWorld, 0), b = See(street, Drive(42), kBFromWorld, 4);
  const WideConnection connection = VerifyWideConnection(a, b, -1, {});
  EXPECT_FALSE(connection.success) << connection.reason;
}

// A camera that turns on the spot knows directions and no depths: no transform follows from them.
TEST_F(WideConnectionTest, PureRotationIsRefused) {
  const std::vector<WidePoint> street = testing::MakeStreet(0, 120, 3000, &random_);
  std::vector<Rigid3> turn_a, turn_b;
  for (int i = 0; i < 8; ++i) {
    turn_a.push_back(testing::StreetPose(0, 0, 0.02 * i));
    turn_b.push_back(testing::StreetPose(0, 0, 0.16 + 0.02 * i));
  }
  const WideSide a = See(street, turn_a, kAFromWorld, 0), b = See(street, turn_b, kBFromWorld, 1);
  const WideConnection connection = VerifyWideConnection(a, b, 0.3, {});
  EXPECT_FALSE(connection.success) << connection.reason;
}

// What moves does not jump: the right transform, but in no time.
TEST_F(WideConnectionTest, AJumpIsRefused) {
  const std::vector<WidePoint> street = testing::MakeStreet(0, 160, 3000, &random_);
  const WideSide a = See(street, Drive(0), kAFromWorld, 0), b = See(street, Drive(70), kBFromWorld, 4);
  WideConnectionOptions options;
  const WideConnection slow = VerifyWideConnection(a, b, 5, options), jump = VerifyWideConnection(a, b, 0.01, options);
  ASSERT_TRUE(slow.success) << slow.reason;
  EXPECT_FALSE(jump.success) << jump.reason;
  EXPECT_NE(jump.reason.find("jumped"), std::string::npos) << jump.reason;
}

}  // namespace wide_connection_test
}  // namespace mapmend
