#include "libs/capture/image_source.h"

#include <gtest/gtest.h>

#include <exiv2/exiv2.hpp>
#include <filesystem>
#include <fstream>
#include <limits>
#include <opencv2/core.hpp>
#include <opencv2/imgcodecs.hpp>

#include "libs/geometry/times_file.h"
#include "tests/scratch_folder.h"
#include "tests/unit/capture/make_video.h"

namespace mapmend {
namespace image_source_test {

std::string Flight(const std::string& name) {
  return std::string(MAPMEND_SOURCE_DIR) + "/data/flights/sheffield_cross/" + name;
}

SourceOptions Of(const std::string& input, const std::string& times = "") {
  SourceOptions options;
  options.inputs = {input};
  options.times_path = times;
  return options;
}

std::string ErrorOf(const std::function<void()>& action) {
  try {
    action();
  } catch (const std::runtime_error& e) {
    return e.what();
  }
  return "";
}

TEST(ImageSource, SkippedFramesKeepTheIndicesAndTimesOfTheOthers) {
  SourceOptions options = Of(Flight("video.mp4"), Flight("times.txt"));
  options.skip = {1, 2};
  ImageSource source(options);
  EXPECT_EQ(source.NumFrames(), 170);
  const auto first = source.Next(), second = source.Next();
  ASSERT_TRUE(first && second);
  EXPECT_EQ(first->index, 0);
  EXPECT_EQ(first->utime, 1525003606000000);
  EXPECT_EQ(second->index, 3);
  EXPECT_EQ(second->utime, ReadFrameTimes(Flight("times.txt")).utimes[3]);
}

TEST(ImageSource, MissingInputAndShortTimesAreNamed) {
  EXPECT_NE(ErrorOf([] { ImageSource(Of("/no/such/video.mp4")); }).find("/no/such/video.mp4"), std::string::npos);
  const auto path = std::filesystem::temp_directory_path() / ("mapmend_times_" + std::to_string(::getpid()));
  std::ofstream(path) << "1.0\n2.0\n";
  EXPECT_NE(ErrorOf([&] {
              ImageSource(Of(Flight("video.mp4"), path.string()));
            }).find("has 2 lines for 172 frames; it needs one for each"),
            std::string::npos);
  std::filesystem::remove(path);
}

class ImageSourceTest : public testing::Test {
 protected:
  std::string Path(const std::string& name) const { return folder_.File(name); }
  // A folder of images of 64 x 48 pixels whose grey value is their number.
  std::string Images(const std::string& folder, int count, int width = 64, int height = 48) {
    std::filesystem::create_directories(Path(folder));
    for (int i = 1; i <= count; ++i) Image(folder + "/f" + std::to_string(i) + ".jpg", i, width, height);
    return Path(folder);
  }
  void Image(const std::string& name, int value, int width = 64, int height = 48) {
    cv::imwrite(Path(name), cv::Mat(height, width, CV_8UC1, cv::Scalar(value)));
  }
  std::string Write(const std::string& name, const std::string& content) {
    std::ofstream(Path(name)) << content;
    return Path(name);
  }
  static std::vector<SourceImage> ReadAll(ImageSource* source) {
    std::vector<SourceImage> images;
    while (auto image = source->Next()) images.push_back(*image);
    return images;
  }
  static std::vector<int> Indices(const std::vector<SourceImage>& images) {
    std::vector<int> indices;
    for (const SourceImage& image : images) indices.push_back(image.index);
    return indices;
  }
  void SetExif(const std::string& name, const std::string& tag, const std::string& value) {
    const auto image = Exiv2::ImageFactory::open(Path(name));
    image->readMetadata();
    image->exifData()["Exif." + tag] = value;
    image->writeMetadata();
  }

  ScratchFolder folder_;
};

TEST_F(ImageSourceTest, ImagesComeInTheOrderOfTheirNumbers) {
  ImageSource source(Of(Images("a", 12)));
  EXPECT_EQ(source.NumFrames(), 12);
  const auto images = ReadAll(&source);
  ASSERT_EQ(images.size(), 12u);
  for (int i = 0; i < 12; ++i) EXPECT_NEAR(images[i].pixels->at<uint8_t>(0, 0), i + 1, 1);
  EXPECT_EQ(source.Problem(), "");
}

TEST_F(ImageSourceTest, OddFramesAreLeftOutAndNamed) {
  const std::string folder = Images("a", 12);
  Image("a/f6.jpg", 6, 32, 24);
  Write("a/f8.jpg", "no image");
  std::filesystem::resize_file(Path("a/f9.jpg"), std::filesystem::file_size(Path("a/f9.jpg")) - 20);
  Write("a/f11.jpg", "");
  ImageSource source(Of(folder, Write("times.txt", "1\n2\n3\n4\n5\n6\n7\n8\n9\n10\n11\n12\n")));
  EXPECT_EQ(source.UsualSize(), std::pair(64, 48));
  const auto images = ReadAll(&source);
  EXPECT_EQ(Indices(images), (std::vector<int>{0, 1, 2, 3, 4, 6, 9, 11}));
  EXPECT_EQ(images.back().utime, 12000000);
  EXPECT_EQ(source.GetLeftOut().Count(), 4);
  EXPECT_EQ(source.Problem(), "input " + folder + ": 4 frames were left out: " + folder +
                                  "/f6.jpg has 32 x 24 pixels, the flight 64 x 48, " + folder +
                                  "/f8.jpg cannot be read as an image, " + folder + "/f9.jpg is cut short, ...");
}

TEST_F(ImageSourceTest, AFirstFrameThatIsOddDoesNotDecide) {
  const std::string folder = Images("a", 8);
  Image("a/f1.jpg", 1, 32, 24);
  ImageSource source(Of(folder));
  EXPECT_EQ(source.UsualSize(), std::pair(64, 48));
  EXPECT_EQ(ReadAll(&source).size(), 7u);
}

TEST_F(ImageSourceTest, ATagThatAsksForRotationIsIgnored) {
  const std::string folder = Images("a", 3);
  SetExif("a/f2.jpg", "Image.Orientation", "6");
  ImageSource source(Of(folder));
  EXPECT_EQ(ReadAll(&source).size(), 3u);
  EXPECT_EQ(source.Problem(), "");
}

TEST_F(ImageSourceTest, OfAFlightWithoutOneGoodFrameTheReasonIsTold) {
  const std::string folder = Images("a", 2);
  SourceOptions options = Of(folder);
  options.width = 640;
  options.height = 480;
  ImageSource source(options);
  EXPECT_EQ(ErrorOf([&] { source.Next(); }), "input " + folder + ": none of its 2 frames could be used; " + folder +
                                                 "/f1.jpg has 64 x 48 pixels, the flight 640 x 480");
}

TEST_F(ImageSourceTest, CaptureTimesOfPhotos) {
  const std::string folder = Images("a", 4);
  for (int i = 1; i <= 4; ++i) {
    SetExif("a/f" + std::to_string(i) + ".jpg", "Photo.DateTimeOriginal",
            i < 4 ? "2018:04:29 12:33:26" : "2018:04:29 12:33:28");
  }
  ImageSource whole(Of(folder));
  const auto images = ReadAll(&whole);
  ASSERT_EQ(images.size(), 4u);
  const int64_t begin = 1525005206000000;
  EXPECT_EQ(images[0].utime, begin);
  EXPECT_EQ(images[1].utime, begin + 333333);
  EXPECT_EQ(images[3].utime, begin + 2000000);
  SetExif("a/f4.jpg", "Photo.SubSecTimeOriginal", "25");
  SetExif("a/f4.jpg", "Photo.OffsetTimeOriginal", "-01:00");
  ImageSource fractions(Of(folder));
  EXPECT_EQ(ReadAll(&fractions)[3].utime, begin + 3602250000);
  SetExif("a/f4.jpg", "Photo.DateTimeOriginal", "2017:04:29 12:33:28");
  ImageSource backward(Of(folder));
  EXPECT_EQ(ReadAll(&backward)[3].utime, 100000);
  EXPECT_NE(backward.Notes()[0].find("f4.jpg is not later"), std::string::npos) << backward.Notes()[0];
}

TEST_F(ImageSourceTest, TimesMustFitTheImages) {
  const std::string folder = Images("a", 3);
  const std::string many = Write("many.txt", "1\n2\n3\n4\n"), few = Write("few.txt", "1\n2\n");
  EXPECT_EQ(ErrorOf([&] { ImageSource(Of(folder, many)); }),
            "times file " + many + " has 4 lines for 3 frames; it needs one for each");
  EXPECT_EQ(ErrorOf([&] { ImageSource(Of(folder, few)); }),
            "times file " + few + " has 2 lines for 3 frames; it needs one for each");
}

TEST_F(ImageSourceTest, AFrameWhoseTimeDoesNotGrowIsLeftOut) {
  const std::string folder = Images("a", 12);
  ImageSource source(Of(folder, Write("times.txt", "1\n2\n3\n4\n4\n6\n7\n8\n9\n10\n11\n12\n")));
  EXPECT_EQ(Indices(ReadAll(&source)), (std::vector<int>{0, 1, 2, 3, 5, 6, 7, 8, 9, 10, 11}));
  EXPECT_NE(source.Problem().find("f5.jpg has a time that is not later"), std::string::npos) << source.Problem();
  const std::string two = Write("two.txt", "1\n2\n3\n4\n4\n6\n7\n7\n9\n10\n11\n12\n");
  EXPECT_NE(ErrorOf([&] { ImageSource(Of(folder, two)); }).find("line 8"), std::string::npos);
}

TEST_F(ImageSourceTest, TimesOfAVideoWhoseCountIsAnEstimate) {
  // Sound of 4 s: the container's length is that of 120 frames.
  Ffmpeg(TestPicture(12) + "-f lavfi -i sine=d=4 -c:v libx264 " + Path("v.mkv"));
  std::string lines;
  for (int i = 0; i < 12; ++i) lines += std::to_string(i) + "\n";
  ImageSource fits(Of(Path("v.mkv"), Write("fits.txt", lines)));
  EXPECT_EQ(ReadAll(&fits).size(), 12u);
  EXPECT_EQ(fits.Problem(), "");
  EXPECT_EQ(fits.NumFrames(), 0);
  EXPECT_EQ(fits.FramesHint(), 12);
  ImageSource few(Of(Path("v.mkv"), Write("few.txt", "1\n2\n")));
  EXPECT_EQ(ReadAll(&few).size(), 2u);
  EXPECT_EQ(few.Problem(), "times file " + Path("few.txt") + " has 2 lines; frame 2 and those behind it have none");
  ImageSource many(Of(Path("v.mkv"), Write("many.txt", lines + "99\n")));
  EXPECT_EQ(ReadAll(&many).size(), 12u);
  EXPECT_EQ(many.Problem(), "times file " + Path("many.txt") + " has 13 lines, the input only 12 frames");
}

TEST_F(ImageSourceTest, PicturesThatCannotBeDecodedAreTold) {
  const std::string video = folder_.File("scratched.mp4");
  Ffmpeg(TestPicture(40) + "-c:v libx264 -g 8 -movflags faststart " + video);
  {
    // Lengths of parts of pictures that there cannot be.
    std::fstream file(video, std::ios::in | std::ios::out | std::ios::binary);
    file.seekp(static_cast<std::streamoff>(std::filesystem::file_size(video) / 2));
    file << std::string(1500, '\xee');
  }
  ImageSource source(Of(video));
  int num_frames = 0;
  while (source.Next()) ++num_frames;
  EXPECT_LT(num_frames, 40);
  EXPECT_GT(num_frames, 20) << "those behind the scratch are read";
  EXPECT_NE(source.Problem().find(" of it cannot be decoded"), std::string::npos) << source.Problem();
}

TEST_F(ImageSourceTest, SeveralFilesAreOneFlight) {
  Ffmpeg(TestPicture(6) + "-c:v libx264 " + Path("a.mp4"));
  Ffmpeg(TestPicture(9) + "-c:v libx264 " + Path("b.mp4"));
  SourceOptions options;
  options.inputs = {Path("a.mp4"), Path("b.mp4")};
  ImageSource source(options);
  EXPECT_EQ(source.NumFrames(), 15);
  const auto images = ReadAll(&source);
  ASSERT_EQ(images.size(), 15u);
  for (int i = 0; i < 15; ++i) {
    EXPECT_EQ(images[i].index, i);
    EXPECT_NEAR(static_cast<double>(images[i].utime), i * 1e6 / 30, 2) << i;
  }
}

TEST_F(ImageSourceTest, ClocksOfTheFilesTellThatTheCameraWasOffInBetween) {
  Ffmpeg(TestPicture(6) + "-c:v libx264 -metadata creation_time=2026-05-01T10:00:00Z " + Path("a.mp4"));
  Ffmpeg(TestPicture(6) + "-c:v libx264 -metadata creation_time=2026-05-01T10:01:00Z " + Path("b.mp4"));
  SourceOptions options;
  options.inputs = {Path("a.mp4"), Path("b.mp4")};
  ImageSource source(options);
  EXPECT_EQ(ReadAll(&source)[6].utime, 60000000);
}

TEST_F(ImageSourceTest, PartsOfAFlight) {
  Ffmpeg(TestPicture(30) + "-c:v libx264 " + Path("a.mp4"));
  SourceOptions options = Of(Path("a.mp4"));
  options.every = 5;
  options.start_s = 0.3;
  options.end_s = 0.8;
  ImageSource source(options);
  EXPECT_EQ(Indices(ReadAll(&source)), (std::vector<int>{10, 15, 20}));
  EXPECT_EQ(source.Problem(), "");
  options.start_s = 0;
  options.end_s = std::numeric_limits<double>::infinity();
  options.skip = {5};
  ImageSource all(options);
  EXPECT_EQ(all.NumFrames(), 5);
  EXPECT_EQ(ReadAll(&all).size(), 5u);
}

TEST_F(ImageSourceTest, AClipThatBeginsAtZeroAgainGoesOn) {
  Ffmpeg(TestPicture(10) + "-c:v mpeg2video -f mpegts " + Path("a.ts"));
  // Two streams joined byte by byte, as some recorders do.
  std::ofstream joined(Path("joined.ts"), std::ios::binary);
  for (int i = 0; i < 2; ++i) joined << std::ifstream(Path("a.ts"), std::ios::binary).rdbuf();
  joined.close();
  ImageSource source(Of(Path("joined.ts")));
  const auto images = ReadAll(&source);
  EXPECT_GE(images.size() + source.GetLeftOut().Count(), 19u);
  EXPECT_LE(source.GetLeftOut().Count(), 3);
  for (size_t i = 1; i < images.size(); ++i) {
    EXPECT_GT(images[i].utime, images[i - 1].utime);
    EXPECT_LT(images[i].utime, images[i - 1].utime + 1000000);
  }
}

}  // namespace image_source_test
}  // namespace mapmend
