#include "procs/mapmend/flight_verdict.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <nlohmann/json.hpp>

namespace mapmend {
namespace flight_verdict_test {

using testing::HasSubstr;
using testing::StartsWith;

FlightFigures Figures(int in, int tracked, int in_main) {
  FlightFigures figures;
  figures.frames_in = in;
  figures.frames_tracked = tracked;
  figures.frames_in_main = in_main;
  figures.num_parts = tracked == 0 ? 0 : 1;
  return figures;
}

TEST(DescribeSmallMap, SaysNothingFromHalfOfTheFlightOn) {
  EXPECT_EQ(DescribeSmallMap(Figures(172, 172, 86)), "");
  EXPECT_EQ(DescribeSmallMap(Figures(171, 171, 86)), "");
  EXPECT_EQ(DescribeSmallMap(Figures(0, 0, 0)), "");
  EXPECT_THAT(DescribeSmallMap(Figures(172, 172, 85)), StartsWith("only 85 of 172 frames (49 %) are in the main map"));
  EXPECT_THAT(DescribeSmallMap(Figures(1000, 3, 3)), StartsWith("only 3 of 1000 frames (under 1 %)"));
}

TEST(DescribeSmallMap, NamesTheCommonestCauseAndWhatToTry) {
  FlightFigures figures = Figures(40, 0, 0);
  figures.untracked = {{"darkness", 36}, {"too_few_matches", 4}};
  EXPECT_EQ(
      DescribeSmallMap(figures),
      "none of the 40 frames is in the map: the images are too dark. Try: more light, a longer exposure, a higher "
      "gain");
  figures.untracked = {{"no_motion", 39}, {"too_few_matches", 1}};
  EXPECT_THAT(DescribeSmallMap(figures), HasSubstr("hardly moves"));
}

TEST(DescribeSmallMap, CausesOfOneKindCountTogether) {
  FlightFigures figures = Figures(40, 0, 0);
  figures.untracked = {{"not_confirmed", 12}, {"no_common_motion", 10}, {"too_few_matches", 15}};
  EXPECT_THAT(DescribeSmallMap(figures), HasSubstr("--camera"));
}

TEST(DescribeSmallMap, TellsAMapInPartsFromOneThatWasNotTracked) {
  FlightFigures figures = Figures(100, 95, 40);
  figures.num_parts = 3;
  figures.untracked = {{"blur", 50}};  // most of them were found afterwards
  EXPECT_THAT(DescribeSmallMap(figures), HasSubstr("in 3 parts"));
  figures.joins_a_map = true;
  EXPECT_THAT(DescribeSmallMap(figures), HasSubstr("no ground with the map that was there"));
}

TEST(DescribeSmallMap, CountsDroppedFramesAsPartOfTheFlight) {
  FlightFigures figures = Figures(50, 50, 50);
  figures.frames_dropped = 50;
  EXPECT_EQ(DescribeSmallMap(figures), "");
  figures.frames_dropped = 51;
  EXPECT_THAT(DescribeSmallMap(figures), HasSubstr("only 50 of 101 frames"));
  EXPECT_THAT(DescribeSmallMap(figures), HasSubstr("--realtime"));
}

TEST(DescribeSmallMap, AVideoOfTwoFramesIsTooShort) {
  FlightFigures figures = Figures(2, 0, 0);
  figures.untracked = {{"too_few_matches", 2}};
  EXPECT_EQ(DescribeSmallMap(figures),
            "none of the 2 frames is in the map: a map needs at least 3 frames with motion between them");
}

TEST(DescribeSmallMap, EveryCauseOfTheFrontendHasWordsAndAdvice) {
  for (const char* cause : {"darkness", "blur", "small_images", "end_of_input", "input_gap", "too_few_features",
                            "too_few_matches", "no_common_motion", "no_motion", "no_parallax", "ambiguous",
                            "not_confirmed", "too_few_inliers", "unsupported_pose", "inconsistent_motion"}) {
    EXPECT_NE(ExplainCause(cause).why, cause);
    EXPECT_NE(ExplainCause(cause).advice, "") << cause;
  }
  EXPECT_EQ(ExplainCause("some_new_cause").why, "some new cause");
}

TEST(DescribeSmallMap, ReadsTheFlightInQuestionFromTheSummary) {
  const auto summary = nlohmann::ordered_json::parse(R"({
    "sessions": [{"id": "first", "frames_in": 100, "frames_tracked": 100, "frames_in_main": 100},
                 {"id": "second", "frames_in": 20, "frames_tracked": 2, "frames_in_main": 2}],
    "components": [{}], "frontend": {"frames_dropped": 0, "untracked": {"blur": 18}}})");
  EXPECT_EQ(DescribeSmallMap(summary, "first"), "");
  EXPECT_THAT(DescribeSmallMap(summary, "second"), HasSubstr("blurred"));
  EXPECT_EQ(DescribeSmallMap(summary, "third"), "");
}

}  // namespace flight_verdict_test
}  // namespace mapmend
