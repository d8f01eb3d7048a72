#include "libs/images/image_file.h"

#include <SQLiteCpp/SQLiteCpp.h>
#include <gtest/gtest.h>

#include <filesystem>

#include "tests/scratch_folder.h"

namespace mapmend {
namespace image_file_test {

KeyframeImage MakeImage(int keyframe, size_t num_bytes, const std::string& session = "s") {
  KeyframeImage image;
  image.session = session;
  image.keyframe = KeyframeId(keyframe);
  image.frame = 10 * keyframe;
  image.utime = 1700000000000000 + keyframe;
  image.width = 800;
  image.height = 600;
  image.encoding = keyframe % 2 == 0 ? "jpeg" : "png";
  for (size_t i = 0; i < num_bytes; ++i)
    image.bytes.push_back(static_cast<uint8_t>(i * 7 + static_cast<size_t>(keyframe)));
  return image;
}

std::string WhatIsThrown(const std::string& path, ImageFile::Mode mode) {
  try {
    const ImageFile file(path, mode);
  } catch (const std::runtime_error& e) {
    return e.what();
  }
  return "";
}

TEST(ImageFile, WhatIsPutComesBackAlsoAfterItWasClosed) {
  const ScratchFolder folder;
  const std::string path = folder.File("images.db");
  const KeyframeImage first = MakeImage(1, 100000), second = MakeImage(2, 30), other = MakeImage(1, 5, "t");
  {
    ImageFile file(path, ImageFile::Mode::kReadWrite);
    EXPECT_FALSE(std::filesystem::exists(path)) << "a file without images is not made";
    EXPECT_TRUE(file.List().empty());
    EXPECT_FALSE(file.Get("s", KeyframeId(1)));
    file.Put({first, second});
    file.Put({other});
    EXPECT_EQ(file.Get("s", KeyframeId(1)), first);
  }
  ImageFile file(path, ImageFile::Mode::kReadWrite);
  EXPECT_EQ(file.Get("s", KeyframeId(1)), first);
  EXPECT_EQ(file.Get("s", KeyframeId(2)), second);
  EXPECT_EQ(file.Get("t", KeyframeId(1)), other);
  ASSERT_EQ(file.List().size(), 3u);
  EXPECT_EQ(file.List()[0].num_bytes, 100000);
  EXPECT_EQ(file.Find("s", KeyframeId(2))->frame, 20);
  EXPECT_TRUE(file.Check().empty());
  // A later image of the same keyframe takes its place.
  const KeyframeImage later = MakeImage(2, 40);
  file.Put({later});
  EXPECT_EQ(file.Get("s", KeyframeId(2)), later);
  file.Remove("s", {KeyframeId(1), KeyframeId(7)});
  EXPECT_FALSE(file.Get("s", KeyframeId(1)));
  EXPECT_TRUE(file.Get("t", KeyframeId(1)));
}

TEST(ImageFile, EveryFlippedByteIsSeen) {
  const ScratchFolder folder;
  const std::string path = folder.File("images.db");
  { ImageFile(path, ImageFile::Mode::kReadWrite).Put({MakeImage(1, 5000), MakeImage(2, 5000)}); }
  for (const char* damage : {"bytes = zeroblob(5000)", "width = 801", "encoding = 'jpeg'", "utime = 3"}) {
    {
      SQLite::Database sql(path, SQLite::OPEN_READWRITE);
      sql.exec(std::string("UPDATE image SET ") + damage + " WHERE keyframe = 1");
    }
    const ImageFile file(path, ImageFile::Mode::kReadOnly);
    EXPECT_FALSE(file.Get("s", KeyframeId(1))) << damage;
    EXPECT_TRUE(file.Get("s", KeyframeId(2)));
    ASSERT_EQ(file.Check().size(), 1u) << damage;
    EXPECT_NE(file.Check()[0].find("image of keyframe 1: its checksum does not fit"), std::string::npos);
  }
}

TEST(ImageFile, FilesOfOthersAreRefusedAndLeftAlone) {
  const ScratchFolder folder;
  EXPECT_NE(WhatIsThrown(folder.File("none.db"), ImageFile::Mode::kReadOnly).find("there is no such file"),
            std::string::npos);
  const std::string path = folder.File("other.db");
  {
    SQLite::Database sql(path, SQLite::OPEN_READWRITE | SQLite::OPEN_CREATE);
    sql.exec("CREATE TABLE mine(x)");
  }
  EXPECT_NE(WhatIsThrown(path, ImageFile::Mode::kReadWrite).find("holds no images of keyframes"), std::string::npos);
  {
    SQLite::Database sql(path, SQLite::OPEN_READWRITE);
    EXPECT_FALSE(sql.tableExists("image"));
    sql.exec("PRAGMA application_id = " + std::to_string(0x4d4d494d));
    sql.exec("PRAGMA user_version = 99");
  }
  EXPECT_NE(WhatIsThrown(path, ImageFile::Mode::kReadWrite).find("use a newer mapmend"), std::string::npos);
}

TEST(ImageFile, ARemovedFileIsNoticed) {
  const ScratchFolder folder;
  const std::string path = folder.File("images.db");
  ImageFile file(path, ImageFile::Mode::kReadWrite);
  EXPECT_FALSE(file.IsGone());
  file.Put({MakeImage(1, 10)});
  EXPECT_FALSE(file.IsGone());
  RemoveImageFile(path);
  EXPECT_TRUE(file.IsGone());
}

TEST(ImageFile, LiesBesideItsDatabase) {
  EXPECT_EQ(ImagePathFor("results/map.db"), "results/images.db");
  EXPECT_EQ(ImagePathFor("two.db"), "two.images.db");
  EXPECT_EQ(SpoolPathFor("results/outbox"), "results/outbox.images");
}

}  // namespace image_file_test
}  // namespace mapmend
