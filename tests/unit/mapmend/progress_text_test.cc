#include "procs/mapmend/progress_text.h"

#include <gtest/gtest.h>

#include "libs/merging/merging_time.h"
#include "procs/mapmend/progress.h"

namespace mapmend {
namespace progress_text_test {

TEST(DescribeFlight, CountsInTheRightNumber) {
  FlightProgress progress;
  progress.frames_total = 172;
  EXPECT_EQ(DescribeFlight(progress), "0/172 frames, 0 submaps, 0 connections");
  progress.frames = 1;
  progress.frames_total = 0;  // a live camera
  progress.fps = 7.55;
  progress.submaps = progress.connections = 1;
  EXPECT_EQ(DescribeFlight(progress), "1 frame, 1 submap, 1 connection, 7.5 frames/s");
}

TEST(DescribeFlight, EstimatesTheMergingToo) {
  FlightProgress progress;
  progress.frames = 100;
  progress.frames_total = 172;
  progress.dropped = 12;
  progress.fps = 10;
  progress.merging_s = 25;
  EXPECT_EQ(DescribeFlight(progress),
            "100/172 frames, 0:06 left and about 0:25 of merging, 0 submaps, 0 connections, 12 dropped, 10.0 frames/s");
}

TEST(DescribeFlight, NamesTheLastLoss) {
  FlightProgress progress;
  progress.frames = 80;
  progress.submaps = 1;
  progress.lost_frame = 73;
  progress.lost_utime = 1525003998250000;
  EXPECT_EQ(DescribeFlight(progress),
            "80 frames, lost after frame 73 (12:13:18), 1 submap, 0 connections, 0.0 frames/s");
  progress.found_frame = 84;
  progress.lost_utime = 2433000;  // not a date
  EXPECT_EQ(DescribeFlight(progress),
            "80 frames, lost after frame 73 (2.433 s), again from 84, 1 submap, 0 connections, 0.0 frames/s");
}

TEST(EstimateMergingSeconds, GrowsWithTheFlight) {
  EXPECT_EQ(EstimateMergingSeconds(3, 0), 0);
  EXPECT_GT(EstimateMergingSeconds(3, 1), 0);
  EXPECT_DOUBLE_EQ(EstimateMergingSeconds(3, 0.5), 2 * EstimateMergingSeconds(3, 1));
}

TEST(DescribeMerging, DoesNotSayZeroLeft) {
  EXPECT_EQ(DescribeMerging(1, 1, 2, 12, 2), "merging, about 0:10 left: 1 connection, 1 in use, 2 parts");
  EXPECT_EQ(DescribeMerging(3, 2, 1, 12, 14), "merging, for 0:14 so far: 3 connections, 2 in use, 1 part");
}

TEST(FitToWidth, LeavesTheLastColumnFree) {
  EXPECT_EQ(FitToWidth("0123456789", 0), "0123456789");
  EXPECT_EQ(FitToWidth("0123456789", 11), "0123456789");
  EXPECT_EQ(FitToWidth("0123456789", 10), "012345...");
  EXPECT_EQ(FitToWidth("0123456789", 2), "0");
}

}  // namespace progress_text_test
}  // namespace mapmend
