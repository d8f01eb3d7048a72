#include "procs/mapmend/evaluation_report.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <nlohmann/json.hpp>

#include "procs/mapmend/raster_canvas.h"

namespace mapmend {
namespace evaluation_report_test {

using ::testing::HasSubstr;

Trajectory Line(const std::vector<double>& positions) {
  Trajectory trajectory;
  for (size_t i = 0; i < positions.size(); ++i) {
    trajectory.push_back(
        {static_cast<int64_t>(i) * 1000000, Rigid3(Eigen::Quaterniond::Identity(), {positions[i], 0, 0})});
  }
  return trajectory;
}

class EvaluationReportTest : public ::testing::Test {
 protected:
  EvaluationReportTest() {
    Add("out/a.tum", Line({0, 1, 2, 3}));
    Add("out/b.tum", Line({0, 1}));
  }
  void Add(const std::string& file, const Trajectory& trajectory) {
    evaluated_.push_back({file, trajectory, EvaluateTrajectory(trajectory, truth_, EvaluationOptions())});
  }
  const Trajectory truth_ = Line({0, 1, 2, 7, 8});
  std::vector<EvaluatedTrajectory> evaluated_;
};

TEST_F(EvaluationReportTest, TableHasALineEachAndTheLargestError) {
  // The line fit by hand: RMSE sqrt(1.2), median 1, max 1.6 at 2 s, scale 2.2, four of five covered.
  const std::string table = FormatEvaluationTable(evaluated_);
  EXPECT_THAT(
      table,
      HasSubstr("out/a.tum       4      4    80.0 %     1.0954     1.0000     1.6000         2.000000        2.2"));
  EXPECT_THAT(table, HasSubstr("not aligned: alignment needs at least 3 pairs, there are 2"));
  EXPECT_THAT(table, HasSubstr("largest error 1.6000 m in out/a.tum"));
}

TEST_F(EvaluationReportTest, JsonHasTheFigures) {
  const auto json = nlohmann::json::parse(FormatEvaluationJson(evaluated_, "gt.tum", EvaluationOptions()));
  EXPECT_EQ(json["groundtruth"], "gt.tum");
  EXPECT_EQ(json["alignment"], "sim3");
  ASSERT_EQ(json["trajectories"].size(), 2u);
  const auto& a = json["trajectories"][0];
  EXPECT_NEAR(a["rmse_m"].get<double>(), std::sqrt(1.2), 1e-12);
  EXPECT_NEAR(a["max_m"].get<double>(), 1.6, 1e-12);
  EXPECT_NEAR(a["coverage"].get<double>(), 0.8, 1e-12);
  EXPECT_NEAR(a["reference_from_estimate"]["scale"].get<double>(), 2.2, 1e-12);
  EXPECT_FALSE(json["trajectories"][1]["success"].get<bool>());
  EXPECT_FALSE(json["trajectories"][1].contains("rmse_m"));
}

TEST_F(EvaluationReportTest, PictureShowsAlignedTrackTruthAndErrors) {
  const TopView view = MakeEvaluationView(evaluated_, truth_);
  ASSERT_EQ(view.tracks.size(), 3u);  // truth, the one that could be aligned, errors
  EXPECT_EQ(view.tracks[0].label, "ground truth");
  EXPECT_EQ(view.tracks[1].label, "a.tum");
  EXPECT_NEAR(view.tracks[1].pieces[0][0].x(), -0.8, 1e-9);
  EXPECT_EQ(view.tracks[2].pieces.size(), 4u);
  const Eigen::Vector2d size = TopViewSize(view);
  RasterCanvas canvas(size.x(), size.y());
  DrawTopView(view, &canvas);
  EXPECT_EQ(canvas.EncodePng().substr(1, 3), "PNG");
}

}  // namespace evaluation_report_test
}  // namespace mapmend
