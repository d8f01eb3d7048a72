#include "procs/mapmend/run_summary.h"

#include <gtest/gtest.h>
#include <unistd.h>

#include <filesystem>
#include <nlohmann/json.hpp>

#include "libs/base/write_file.h"
#include "procs/mapmend/progress.h"

namespace mapmend {
namespace run_summary_test {

class RunSummaryTest : public testing::Test {
 protected:
  RunSummaryTest() : out_(testing::TempDir() + "/run_summary_" + std::to_string(getpid())) {
    std::filesystem::create_directories(out_);
  }
  ~RunSummaryTest() override { std::filesystem::remove_all(out_); }
  std::string out_;
};

TEST_F(RunSummaryTest, AddsWhatOnlyTheLauncherKnowsAndKeepsTheRest) {
  WriteFile(out_ + "/summary.json", R"({"frames_in": 172, "ate_rmse_m": 0.15})");
  LauncherFigures figures;
  figures.title = "Monday";
  figures.wall_s = 64.25;
  figures.track_ms_median = 14.5;
  figures.track_ms_p95 = 37.25;
  figures.processes = {{"hub", {0.5, 70}}, {"frontend", {12.25, 122}}};
  CompleteSummary(out_, figures);
  const auto summary = nlohmann::json::parse(ReadFile(out_ + "/summary.json"));
  EXPECT_EQ(summary, nlohmann::json::parse(R"({
    "frames_in": 172, "ate_rmse_m": 0.15, "title": "Monday", "wall_s": 64.25, "frontend": {"track_ms_median": 14.5, "track_ms_p95": 37.25},
    "processes": [{"name": "hub", "cpu_s": 0.5, "peak_rss_mb": 70}, {"name": "frontend", "cpu_s": 12.25, "peak_rss_mb": 122}]})"));
}

TEST_F(RunSummaryTest, NamesTheWeakConnectionsThatHoldTheMapTogether) {
  WriteFile(out_ + "/summary.json", R"json({
    "connections": [{"a": 0, "b": 1, "verdict": "accepted", "in_tree": true, "weak": true},
                    {"a": 0, "b": 2, "verdict": "accepted", "in_tree": false, "weak": true},
                    {"a": 1, "b": 2, "verdict": "accepted", "in_tree": true, "weak": false},
                    {"a": 2, "b": 5, "verdict": "accepted", "in_tree": true, "weak": true}]})json");
  EXPECT_NE(FormatSummaryTable(out_).find("4 accepted of 4 evaluated; weak: 0–1, 2–5 (the report says how weak)"),
            std::string::npos)
      << FormatSummaryTable(out_);
}

TEST_F(RunSummaryTest, PrintsATable) {
  WriteFile(out_ + "/summary.json", R"json({
    "frames_in": 172, "frames_tracked": 171, "frames_in_main": 86, "holes_in_words": "1 hole: frames 74 to 83 (10 frames, 66 s)", "losses": 1, "keyframes_in_main": 80, "keyframes_total": 166,
    "points_in_main": 7242, "submaps": [{"end_reason": "too_few_matches", "last_frame": 73}, {"end_reason": "end_of_input", "last_frame": 171}],
    "components": [{}, {}], "wall_s": 86.0,
    "connections": [{"verdict": "accepted"}, {"verdict": "rejected"}], "loops": [{"verdict": "accepted"}, {"verdict": "rejected"}],
    "processes": [{"name": "hub", "cpu_s": 0.5, "peak_rss_mb": 70}]})json");
  EXPECT_EQ(FormatSummaryTable(out_),
            "  frames       172 read, 171 tracked, 86 in the main map (50.0 % of the flight)\n"
            "  holes        1 hole: frames 74 to 83 (10 frames, 66 s)\n"
            "  losses       1: after frame 73 (too few matches)\n"
            "  submaps      2 in 2 parts\n"
            "  connections  1 accepted of 2 evaluated\n"
            "  loops        closed within 1 submap\n"
            "  keyframes    80 of 166 in the main map, 7242 points\n"
            "  time         1:26 (2.0 frames/s)\n"
            "  hub              0.5 CPU s      70 MB\n");
}

TEST_F(RunSummaryTest, TellsWhyThereIsNoAccuracy) {
  WriteFile(out_ + "/summary.json",
            R"({"frames_in": 3, "groundtruth": "gt.tum", "groundtruth_problem": "no pose fits"})");
  EXPECT_NE(FormatSummaryTable(out_).find("accuracy     unknown: no pose fits"), std::string::npos);
}

TEST_F(RunSummaryTest, TellsWhatWasDroppedAndRefused) {
  WriteFile(out_ + "/summary.json", R"({"frames_in": 3})");
  LauncherFigures figures;
  figures.mode = "live";
  figures.frames_dropped = 12;
  figures.bad_messages = 2;
  figures.shutter = ShutterFigures{34.56, true};
  CompleteSummary(out_, figures);
  const auto summary = nlohmann::json::parse(ReadFile(out_ + "/summary.json"));
  EXPECT_EQ(
      summary["frontend"],
      nlohmann::json::parse(R"({"mode": "live", "frames_dropped": 12, "frames_left_out": 0, "bad_messages": 2})"));
  const std::string table = FormatSummaryTable(out_);
  EXPECT_NE(table.find("  dropped      12 frames that came while the frontend was busy\n"), std::string::npos) << table;
  EXPECT_NE(table.find("  refused      2 images; see logs"), std::string::npos) << table;
  EXPECT_EQ(summary["readout_ms"], 34.56);
  EXPECT_EQ(summary["readout_by"], "columns");
  EXPECT_NE(table.find("  shutter      rolling, 34.6 ms from the first to the last column; corrected\n"),
            std::string::npos)
      << table;
}

TEST_F(RunSummaryTest, TellsTheTimeOfEachStage) {
  WriteFile(out_ + "/summary.json", R"({"frames_in": 3})");
  LauncherFigures figures;
  figures.profile_json =
      R"([{"stage": "track/motion", "frames": 3, "median_ms": 1.25, "p95_ms": 2.5, "total_s": 0.004}])";
  CompleteSummary(out_, figures);
  const auto summary = nlohmann::json::parse(ReadFile(out_ + "/summary.json"));
  EXPECT_EQ(summary["frontend"]["profile"], nlohmann::json::parse(figures.profile_json));
  const std::string table = FormatSummaryTable(out_);
  EXPECT_NE(table.find("  track/motion                3        1.25      2.50      0.00\n"), std::string::npos)
      << table;
  figures.profile_json = "[";
  EXPECT_THROW(CompleteSummary(out_, figures), std::runtime_error);
}

TEST_F(RunSummaryTest, NamesASummaryThatIsNone) {
  WriteFile(out_ + "/summary.json", "[]");
  try {
    FormatSummaryTable(out_);
    FAIL() << "no error";
  } catch (const std::runtime_error& e) {
    EXPECT_EQ(e.what(), out_ + "/summary.json is not a JSON object");
  }
}

TEST(FormatDuration, ShowsHoursOnlyWhenThereAreSome) {
  EXPECT_EQ(FormatDuration(5.4), "0:05");
  EXPECT_EQ(FormatDuration(65), "1:05");
  EXPECT_EQ(FormatDuration(3725), "1:02:05");
}

}  // namespace run_summary_test
}  // namespace mapmend
