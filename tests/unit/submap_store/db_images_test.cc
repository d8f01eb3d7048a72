#include "procs/submap_store/db_images.h"

#include <gtest/gtest.h>

#include <filesystem>

#include "libs/images/image_file.h"
#include "procs/submap_store/db_commands.h"
#include "tests/scratch_folder.h"
#include "tests/unit/submap_store/filled_db.h"

namespace mapmend {
namespace db_images_test {

// A flight with an image for each keyframe that was not culled. Returns how many.
int FillWithImages(const std::string& db, const std::string& session) {
  SyntheticStreamOptions flight;
  flight.session = session;
  FillWithFlight(db, flight);
  std::vector<KeyframeImage> images;
  {
    Database database(db, Database::Mode::kReadOnly);
    auto rows = database.Prepare("SELECT keyframe, frame FROM keyframe WHERE removed_seq IS NULL");
    while (rows->executeStep()) {
      KeyframeImage image;
      image.session = session;
      image.keyframe = KeyframeId(rows->getColumn(0).getInt());
      image.frame = rows->getColumn(1).getInt();
      image.width = image.height = 10;
      image.encoding = std::string("jpeg");
      image.bytes.assign(1000, 7);
      images.push_back(std::move(image));
    }
  }
  ImageFile(ImagePathFor(db), ImageFile::Mode::kReadWrite).Put(images);
  return static_cast<int>(images.size());
}

const char kFirst[] = "00000000-0000-4000-8000-000000000001", kSecond[] = "00000000-0000-4000-8000-000000000002";

TEST(DbImages, AreCountedAndCheckedAgainstTheMap) {
  const ScratchFolder folder;
  const std::string db = folder.File("map.db");
  const int count = FillWithImages(db, kFirst);
  ASSERT_GT(count, 3);
  EXPECT_EQ(CountImages(db).stored, count);
  EXPECT_EQ(CountImages(db).missing, 0);
  EXPECT_EQ(CountImages(db).bytes, 1000LL * count);
  EXPECT_TRUE(CheckImages(db).empty());
  KeyframeImage stranger;
  {
    ImageFile file(ImagePathFor(db), ImageFile::Mode::kReadWrite);
    stranger = *file.Get(kFirst, file.List()[0].keyframe);
    stranger.keyframe = KeyframeId(99999);
    file.Put({stranger});
    KeyframeImage other_frame = *file.Get(kFirst, file.List()[0].keyframe);
    other_frame.frame += 1;
    file.Put({other_frame});
  }
  const std::vector<std::string> problems = CheckImages(db);
  ASSERT_EQ(problems.size(), 2u);
  EXPECT_NE(problems[0].find(": is of another frame"), std::string::npos) << problems[0];
  EXPECT_NE(problems[1].find("image of keyframe 99999: the map has no such keyframe"), std::string::npos);
  CompactImages(db);
  EXPECT_TRUE(CheckImages(db).empty());
  EXPECT_EQ(CountImages(db).stored, count - 1);
  EXPECT_EQ(CountImages(db).missing, 1);
}

TEST(DbImages, FollowTheirFlightsIntoAMergedDatabase) {
  const ScratchFolder folder;
  const std::string first = folder.File("first.db"), second = folder.File("second.db"), out = folder.File("both.db");
  const int in_first = FillWithImages(first, kFirst), in_second = FillWithImages(second, kSecond);
  MergeDbs({first, second}, out);
  EXPECT_EQ(MergeImages({first, second}, out), in_first + in_second);
  EXPECT_EQ(CountImages(out).stored, in_first + in_second);
  EXPECT_EQ(CountImages(out).missing, 0);
  EXPECT_TRUE(CheckImages(out).empty());
}

TEST(DbImages, AMapWithoutThemIsAGoodOne) {
  const ScratchFolder folder;
  const std::string db = folder.File("map.db");
  const int count = FillWithImages(db, kFirst);
  const DbHash hash = HashDb(db);
  RemoveImageFile(ImagePathFor(db));
  EXPECT_TRUE(CheckDb(db).empty());
  EXPECT_TRUE(CheckImages(db).empty());
  EXPECT_EQ(HashDb(db).stream, hash.stream);
  EXPECT_EQ(CountImages(db).missing, count);
  CompactImages(db);
  EXPECT_FALSE(std::filesystem::exists(ImagePathFor(db))) << "none is made";
}

}  // namespace db_images_test
}  // namespace mapmend
