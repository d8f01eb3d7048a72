#include "libs/formats/map_formats.h"

#include <gtest/gtest.h>

#include <filesystem>

#include "libs/command_line/command_line.h"
#include "tests/scratch_folder.h"
#include "tests/unit/formats/test_map.h"

namespace mapmend {
namespace map_formats_test {

TEST(MapFormats, ListsAreReadAndUnknownOnesAreToldTheKnownOnes) {
  EXPECT_EQ(ParseFormats({"las,mcap", "g2o,las"}), (std::vector<std::string>{"las", "mcap", "g2o"}));
  EXPECT_TRUE(ParseFormats({}).empty());
  try {
    ParseFormats({"las,mcpa"});
    FAIL();
  } catch (const UsageError& e) {
    EXPECT_STREQ(e.what(),
                 "--format: no format 'mcpa'; did you mean mcap? (there are tum, ply, colmap, kitti, euroc, las, g2o, "
                 "gltf, mcap)");
  }
}

TEST(MapFormats, EveryFormatWritesTheFilesThatItNames) {
  const ScratchFolder folder;
  int num_written = 0;
  EXPECT_TRUE(FormatsIn(folder.Path()).empty());
  for (const MapFormat& format : MapFormats()) {
    if (format.is_always_written) continue;
    WriteFormat(format.name, MakeTestMap(), folder.Path());
    for (const std::string& file : format.files) {
      EXPECT_GT(std::filesystem::file_size(folder.File(file)), 0u) << file;
      ++num_written;
    }
    EXPECT_EQ(FormatsIn(folder.Path()).back(), format.name);
  }
  EXPECT_EQ(num_written, 7);
}

TEST(MapFormats, AFrameIsDescribedWithItsUnit) {
  EXPECT_EQ(Describe(FrameOfReference()), "frame map, unit map units (arbitrary)");
  EXPECT_EQ(Describe(MakeUtmMap().frame),
            "frame utm (EPSG:32630), unit metre; add 598765.000 5912345.000 120.000 to the coordinates");
}

}  // namespace map_formats_test
}  // namespace mapmend
