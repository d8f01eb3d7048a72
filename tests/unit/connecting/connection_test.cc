#include "libs/connecting/connection.h"

#include <gtest/gtest.h>

namespace mapmend {
namespace connection_test {

ConnectedFrames Pair(int a, int b, int num_inliers) {
  ConnectedFrames frames;
  frames.keyframe_a = KeyframeId(a);
  frames.keyframe_b = KeyframeId(b);
  frames.num_inliers = num_inliers;
  return frames;
}

TEST(Connection, WhatIsAnnouncedNamesThePairsThatAgree) {
  Connection connection;
  connection.a = {"s", SubmapId(0)};
  connection.b = {"s", SubmapId(1)};
  connection.verdict = Connection::Verdict::kAccepted;
  connection.reason = "two of three agree";
  connection.strength = 12.5;
  connection.in_tree = true;
  connection.evidence = {Pair(1, 21, 40), Pair(2, 35, 30), Pair(3, 23, 50)};
  connection.agrees = {1, 0, 1};
  const EvaluatedConnection announced = Announced(connection);
  EvaluatedConnection expected = connection;
  expected.pairs = {{KeyframeId(1), KeyframeId(21), 40}, {KeyframeId(3), KeyframeId(23), 50}};
  EXPECT_EQ(announced, expected);
  EXPECT_EQ(announced.strength, 12.5);
}

}  // namespace connection_test
}  // namespace mapmend
