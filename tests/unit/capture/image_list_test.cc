#include "libs/capture/image_list.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <filesystem>
#include <fstream>

#include "libs/capture/fingerprint.h"
#include "libs/capture/times_beside.h"
#include "tests/scratch_folder.h"

namespace mapmend {
namespace image_list_test {

namespace fs = std::filesystem;

class ImageListTest : public testing::Test {
 protected:
  void Write(const std::string& name, const std::string& content = "x") {
    fs::create_directories(fs::path(folder_.File(name)).parent_path());
    std::ofstream(folder_.File(name)) << content;
  }
  std::vector<std::string> Names(const ImageList& list) const {
    std::vector<std::string> names;
    for (const std::string& file : list.files)
      names.push_back(fs::path(file).lexically_relative(folder_.Path()).string());
    return names;
  }

  ScratchFolder folder_;
};

TEST_F(ImageListTest, NumbersInNamesCountAsNumbers) {
  for (const char* name : {"frame10.jpg", "frame2.jpg", "frame1.JPG", "frame9.png"}) Write(name);
  const ImageList list = ListImages(folder_.Path());
  EXPECT_EQ(Names(list), (std::vector<std::string>{"frame1.JPG", "frame2.jpg", "frame9.png", "frame10.jpg"}));
  ASSERT_EQ(list.notes.size(), 1u);
  EXPECT_NE(list.notes[0].find("frame1.JPG first, frame10.jpg last"), std::string::npos) << list.notes[0];
}

TEST_F(ImageListTest, NaturalOrderIsAnOrder) {
  const std::vector<std::string> sorted = {"a", "a0", "a00", "a01", "a1", "a1b", "a1b2", "a1b10", "a2", "a10", "b"};
  for (size_t i = 0; i < sorted.size(); ++i) {
    for (size_t j = 0; j < sorted.size(); ++j) {
      EXPECT_EQ(NaturalLess(sorted[i], sorted[j]), i < j) << sorted[i] << " " << sorted[j];
    }
  }
}

TEST_F(ImageListTest, WhatOnlyLooksLikeAnImageIsPassedOverAndTold) {
  Write("f1.jpg");
  Write("._f1.jpg");
  Write("notes.txt");
  fs::create_directory(folder_.File("folder.jpg"));
  fs::create_symlink("/no/such/file", folder_.File("link.png"));
  fs::create_symlink(folder_.File("f1.jpg"), folder_.File("good_link.jpg"));
  const ImageList list = ListImages(folder_.Path());
  EXPECT_EQ(Names(list), (std::vector<std::string>{"f1.jpg", "good_link.jpg"}));
  ASSERT_EQ(list.notes.size(), 1u);
  EXPECT_EQ(
      list.notes[0],
      "3 entries only look like images and are passed over: ._f1.jpg (hidden), folder.jpg (a folder), link.png (a "
      "link to nothing)");
}

TEST_F(ImageListTest, CopiesOfPhotosAreLeftOutAndTold) {
  Write("DSC1.jpg", "first");
  Write("DSC1 (2).jpg", "first");
  Write("DSC1 - Copy.jpg", "first");
  Write("DSC2.jpg", "second");
  Write("DSC2 (1).jpg", "another");  // a name alone is no proof
  Write("DSC3.jpg", "second");       // nor are bytes: a camera may stand still
  Write("DSC4 copy 2.jpg", "fourth");
  const ImageList list = ListImages(folder_.Path());
  EXPECT_EQ(Names(list),
            (std::vector<std::string>{"DSC1.jpg", "DSC2 (1).jpg", "DSC2.jpg", "DSC3.jpg", "DSC4 copy 2.jpg"}));
  ASSERT_FALSE(list.notes.empty());
  EXPECT_EQ(list.notes.back(), "2 copies of other images are left out: DSC1 (2).jpg, DSC1 - Copy.jpg");
}

TEST_F(ImageListTest, AMemoryCardHoldsItsPhotosInSubfolders) {
  for (const char* name : {"DCIM/101MEDIA/DJI_0001.JPG", "DCIM/100MEDIA/DJI_0999.JPG", "DCIM/100MEDIA/DJI_0998.JPG"})
    Write(name);
  EXPECT_EQ(Names(ListImages(folder_.Path())),
            (std::vector<std::string>{"DCIM/100MEDIA/DJI_0998.JPG", "DCIM/100MEDIA/DJI_0999.JPG",
                                      "DCIM/101MEDIA/DJI_0001.JPG"}));
  Write("own.jpg");
  EXPECT_EQ(Names(ListImages(folder_.Path())), std::vector<std::string>{"own.jpg"});
}

TEST_F(ImageListTest, AFolderWithoutImagesSaysWhatItHoldsInstead) {
  const auto error = [&](const std::string& folder) -> std::string {
    try {
      ListImages(folder_.File(folder));
    } catch (const std::runtime_error& e) {
      return e.what();
    }
    return "";
  };
  const std::string none = " holds no images (jpg, png, bmp, tif, pgm, ppm, webp)";
  Write("notes/readme.txt");
  EXPECT_EQ(error("notes"), "input folder " + folder_.File("notes") + none);
  Write("raw/100MEDIA/DJI_0002.DNG");
  EXPECT_EQ(error("raw"), "input folder " + folder_.File("raw") + none +
                              "; DJI_0002.DNG and its like are not read: make JPEGs of them");
  for (const char* name : {"card/GX020042.MP4", "card/GX010042.MP4", "card/._GX000042.MP4"}) Write(name);
  EXPECT_EQ(error("card"), "input folder " + folder_.File("card") + none +
                               "; videos are inputs one by one: " + folder_.File("card/GX010042.MP4"));
}

TEST_F(ImageListTest, FingerprintsTellContentApartNotNames) {
  Write("monday/images/f1.jpg", "one");
  Write("tuesday/images/f1.jpg", "two");
  Write("copy/x.jpg", "one");
  const auto of = [&](const char* name) { return ContentFingerprint({folder_.File(name)}); };
  EXPECT_NE(of("monday/images"), of("tuesday/images"));
  EXPECT_EQ(of("monday/images"), of("copy"));
  Write("copy/y.jpg", "");
  EXPECT_NE(of("monday/images"), of("copy"));
}

TEST_F(ImageListTest, TimesBesideTwoVideosBelongToNobody) {
  Write("times.txt", "1\n");
  Write("a.mp4");
  const std::string a = folder_.File("a.mp4"), b = folder_.File("b.MOV");
  EXPECT_EQ(FindTimesBeside({a}).path, folder_.File("times.txt"));
  Write("b.MOV");
  EXPECT_EQ(FindTimesBeside({a}).path, "");
  EXPECT_NE(FindTimesBeside({a}).note.find("b.MOV"), std::string::npos);
  EXPECT_EQ(FindTimesBeside({a, b}).path, folder_.File("times.txt"));
  EXPECT_EQ(FindTimesBeside({folder_.Path()}).path, folder_.File("times.txt"));
}

}  // namespace image_list_test
}  // namespace mapmend
