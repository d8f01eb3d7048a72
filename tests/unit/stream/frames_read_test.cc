#include "libs/stream/frames_read.h"

#include <gtest/gtest.h>

namespace mapmend {
namespace frames_read_test {

int Count(const std::string& settings, int first_frame, int last_frame) {
  SessionStarted start;
  start.settings_json = settings;
  return CountFramesRead(start, first_frame, last_frame);
}

TEST(CountFramesRead, LeavesOutWhatTheSettingsLeaveOut) {
  EXPECT_EQ(Count("{}", 0, 99), 100);
  EXPECT_EQ(Count(R"({"skip_frames": "0-39,90-200"})", 40, 99), 50);
  EXPECT_EQ(Count(R"({"every": 3})", 0, 10), 4) << "0 3 6 9";
  EXPECT_EQ(Count(R"({"every": 2, "skip_frames": "2,3"})", 0, 6), 3) << "0 4 6";
  EXPECT_EQ(Count(R"({"start_s": 2.5})", 30, 99), 70);
  EXPECT_EQ(Count(R"({"first_frame": 60, "continues": "a"})", 62, 99), 40) << "the rest is the first part's";
}

TEST(CountFramesRead, OfNoFrameThereIsNone) {
  EXPECT_EQ(Count("{}", -1, -1), 0);
  EXPECT_EQ(Count(R"({"start_s": 3})", -1, -1), 0);
}

TEST(CountFramesRead, SettingsOfAnotherProgramLeaveNothingOut) {
  for (const char* settings :
       {"", "no json", "[]", R"({"skip_frames": 5})", R"({"skip_frames": "x-y"})", R"({"every": 0})",
        R"({"every": "2"})", R"({"first_frame": -7})", R"({"start_s": null})"}) {
    EXPECT_EQ(Count(settings, 0, 9), 10) << settings;
  }
}

}  // namespace frames_read_test
}  // namespace mapmend
