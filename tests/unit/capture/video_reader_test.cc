#include "libs/capture/video_reader.h"

#include <gtest/gtest.h>

#include <cmath>
#include <filesystem>
#include <opencv2/core.hpp>
#include <opencv2/videoio.hpp>
#include <vector>

#include "tests/scratch_folder.h"
#include "tests/unit/capture/make_video.h"

namespace mapmend {
namespace video_reader_test {

struct Read {
  int frames = 0;
  std::vector<int64_t> utimes;  // -1: unknown
  std::string cut;
  VideoInfo info;
};

Read ReadAll(const std::string& path) {
  VideoReader reader(path);
  Read read;
  read.info = reader.Info();
  while (reader.Grab()) {
    ++read.frames;
    read.utimes.push_back(reader.Utime().value_or(-1));
  }
  read.cut = reader.Cut();
  return read;
}

class VideoReaderTest : public testing::Test {
 protected:
  // A video of 40 frames, with B-frames, beside which others are made.
  void SetUp() override {
    base_ = folder_.File("base.mp4");
    Ffmpeg(TestPicture(40) + "-c:v libx264 -bf 2 -g 12 " + base_);
  }
  std::string Make(const std::string& arguments, const std::string& name) {
    Ffmpeg(arguments + " " + folder_.File(name));
    return folder_.File(name);
  }
  std::string Cut(const std::string& path, const std::string& name) {
    const std::string cut = folder_.File(name);
    std::filesystem::copy_file(path, cut);
    std::filesystem::resize_file(cut, std::filesystem::file_size(path) * 6 / 10);
    return cut;
  }

  ScratchFolder folder_;
  std::string base_;
};

TEST_F(VideoReaderTest, PicturesAreThoseOfOpenCV) {
  VideoReader reader(base_);
  cv::VideoCapture capture(base_, cv::CAP_FFMPEG);
  cv::Mat expected;
  int frames = 0;
  for (; reader.Grab(); ++frames) {
    ASSERT_TRUE(capture.read(expected));
    ASSERT_EQ(cv::norm(reader.Pixels(), expected, cv::NORM_INF), 0) << frames;
  }
  EXPECT_EQ(frames, 40);
  EXPECT_EQ(reader.Info().num_frames, 40);
}

TEST_F(VideoReaderTest, VideosWithoutACountOfFramesAreReadToTheEnd) {
  for (const std::string& path :
       {Make("-i " + base_ + " -c copy", "raw.h264"), Make(TestPicture(40) + "-c:v mjpeg", "raw.mjpeg"),
        Make("-i " + base_ + " -c copy -f matroska - >", "pipe.mkv"),
        Make(TestPicture(40) + "-c:v libvpx -f webm - >", "pipe.webm"),
        Make("-i " + base_ + " -c copy -movflags frag_keyframe+empty_moov", "fragments.mp4")}) {
    const Read read = ReadAll(path);
    EXPECT_EQ(read.frames, 40) << path;
    EXPECT_EQ(read.info.num_frames, 0) << path;
    EXPECT_GE(read.info.frames_hint, 0) << path;
    EXPECT_EQ(read.cut, "") << path;
  }
}

TEST_F(VideoReaderTest, AnEstimateOfTheCountIsNoPromise) {
  for (const char* name : {"sound.mkv", "sound.flv", "sound.ts", "sound.mp4", "sound.avi"}) {
    const Read read = ReadAll(Make("-i " + base_ + " -f lavfi -i sine=d=4 -c:v copy", name));
    EXPECT_EQ(read.frames, 40) << name;
    EXPECT_EQ(read.cut, "") << name;
  }
  const Read trimmed = ReadAll(Make("-ss 0.5 -i " + base_ + " -c copy", "edit.mp4"));
  EXPECT_EQ(trimmed.frames, trimmed.info.num_frames);
  EXPECT_LT(trimmed.frames, 40);
  EXPECT_EQ(trimmed.cut, "");
}

TEST_F(VideoReaderTest, AFileThatEndsEarlyIsTold) {
  for (const char* name : {"whole.mp4", "whole.mkv", "whole.avi"}) {
    const Read read =
        ReadAll(Cut(Make("-i " + base_ + " -c copy -movflags faststart", name), std::string("cut_") + name));
    EXPECT_GT(read.frames, 10) << name;
    EXPECT_LT(read.frames, 40) << name;
    EXPECT_EQ(read.cut, "the file is truncated or damaged") << name;
  }
}

// As players and drones write that must not lose all by a power cut: no list of frames tells how many there were.
TEST_F(VideoReaderTest, AFileOfFragmentsThatEndsWithinOneIsTold) {
  const std::string whole = Make("-i " + base_ + " -c copy -movflags frag_keyframe+empty_moov", "fragments.mp4");
  const Read read = ReadAll(whole), cut = ReadAll(Cut(whole, "cut_fragments.mp4"));
  EXPECT_EQ(read.frames, 40);
  EXPECT_EQ(read.cut, "");
  EXPECT_LT(cut.frames, 40);
  EXPECT_GT(cut.frames, 10);
  EXPECT_EQ(cut.cut, "the file is truncated or damaged");
}

TEST_F(VideoReaderTest, TimesAreThoseOfTheContainerToTheLastFrame) {
  // All frames up to 7, then each third: 0 to 7, 9, 12, ... 39.
  const std::string varied =
      Make(TestPicture(40) + "-vf \"select='not(mod(n,3))+lt(n,8)'\" -vsync vfr -c:v libx264 -bf 2", "varied.mp4");
  std::vector<int64_t> expected;
  for (int n = 0; n < 40; ++n) {
    if (n % 3 == 0 || n < 8) expected.push_back(std::llround(n * 1e6 / 30));
  }
  EXPECT_EQ(ReadAll(varied).utimes, expected);
  const Read matroska = ReadAll(Make("-i " + varied + " -c copy", "varied.mkv"));
  ASSERT_EQ(matroska.utimes.size(), expected.size());
  for (size_t i = 0; i < expected.size(); ++i) EXPECT_NEAR(matroska.utimes[i], expected[i], 1000);
  const Read bare = ReadAll(Make("-i " + base_ + " -c copy", "raw.h264"));
  EXPECT_FALSE(bare.info.has_times);
  EXPECT_EQ(bare.utimes.front(), -1);
}

TEST_F(VideoReaderTest, ACoverBeforeTheFlightIsPassedOver) {
  const std::string cover = Make(TestPicture(1) + "-vf scale=80:60 -c:v mjpeg -frames:v 1", "cover.mov");
  const Read read = ReadAll(Make("-i " + cover + " -i " + base_ + " -map 0 -map 1 -c copy", "cover_first.mp4"));
  EXPECT_EQ(read.frames, 40);
  EXPECT_EQ(read.info.width, 160);
  EXPECT_EQ(read.info.track_note, "2 video tracks; number 2 of 160 x 120 pixels is taken");
}

TEST_F(VideoReaderTest, ATagThatAsksForRotationIsIgnored) {
  const Read read = ReadAll(Make("-i " + base_ + " -c copy -metadata:s:v rotate=90", "rotated.mp4"));
  EXPECT_EQ(read.info.width, 160);
  VideoReader reader(folder_.File("rotated.mp4")), upright(base_);
  ASSERT_TRUE(reader.Grab() && upright.Grab());
  EXPECT_EQ(cv::norm(reader.Pixels(), upright.Pixels(), cv::NORM_INF), 0);
}

TEST_F(VideoReaderTest, NamesMayHoldColonsAndPercentSigns) {
  for (const char* name : {"2026-01-01T12:00:00.mp4", "100%d.mp4", "-x.mp4"}) {
    std::filesystem::copy_file(base_, folder_.File(name));
    EXPECT_EQ(ReadAll(folder_.File(name)).frames, 40) << name;
  }
  const auto before = std::filesystem::current_path();
  std::filesystem::current_path(folder_.Path());
  EXPECT_EQ(ReadAll("2026-01-01T12:00:00.mp4").frames, 40);
  EXPECT_EQ(ReadAll("-x.mp4").frames, 40);
  std::filesystem::current_path(before);
}

TEST_F(VideoReaderTest, PicturesOfAnyWidthStayWithinTheirMemory) {
  for (const char* size : {"162:122", "200:150", "98:50", "16:16"}) {
    const std::string path = Make(TestPicture(2) + "-vf scale=" + size + " -c:v libx264", "sized.mp4");
    VideoReader reader(path);
    std::vector<cv::Mat> kept;
    while (reader.Grab()) kept.push_back(reader.Pixels().clone());
    EXPECT_EQ(kept.size(), 2u) << size;
  }
}

}  // namespace video_reader_test
}  // namespace mapmend
