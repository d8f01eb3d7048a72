#include "libs/formats/las.h"

#include <gtest/gtest.h>

#include <stdexcept>
#include <vector>

#include "libs/formats/wkt.h"
#include "tests/unit/formats/byte_reader.h"
#include "tests/unit/formats/test_map.h"

namespace mapmend {
namespace las_test {

struct LasPoint {
  Eigen::Vector3d position;
  uint8_t returns, user_data;
  uint16_t source;
  std::array<uint16_t, 3> color;
};

struct LasFile {
  uint16_t encoding, year, day;
  std::string system;
  Eigen::Vector3d scale, low, high;
  std::string wkt;  // empty: no such record
  std::vector<LasPoint> points;
};

void Require(bool holds, const char* what) {
  if (!holds) throw std::runtime_error(what);
}

// As strict as the specification, for what mapmend writes.
LasFile Read(const std::string& bytes) {
  LasFile file;
  ByteReader in(bytes);
  Require(in.Bytes(4) == "LASF", "signature");
  in.Take<uint16_t>();
  file.encoding = in.Take<uint16_t>();
  in.Bytes(16);
  Require(in.Take<uint8_t>() == 1 && in.Take<uint8_t>() == 4, "version");
  file.system = in.Bytes(32).c_str();
  in.Bytes(32);
  file.day = in.Take<uint16_t>();
  file.year = in.Take<uint16_t>();
  Require(in.Take<uint16_t>() == 375, "header size");
  const auto points_at = in.Take<uint32_t>(), num_records = in.Take<uint32_t>();
  Require(in.Take<uint8_t>() == 7 && in.Take<uint16_t>() == 36, "point format");
  for (int i = 0; i < 6; ++i) Require(in.Take<uint32_t>() == 0, "old counts");
  Eigen::Vector3d offset;
  for (int i = 0; i < 3; ++i) file.scale[i] = in.Take<double>();
  for (int i = 0; i < 3; ++i) offset[i] = in.Take<double>();
  for (int i = 0; i < 3; ++i) {
    file.high[i] = in.Take<double>();
    file.low[i] = in.Take<double>();
  }
  Require(in.Take<uint64_t>() == 0 && in.Take<uint64_t>() == 0 && in.Take<uint32_t>() == 0, "extended records");
  const auto count = in.Take<uint64_t>();
  Require(in.Take<uint64_t>() == count, "first returns");
  for (int i = 1; i < 15; ++i) Require(in.Take<uint64_t>() == 0, "other returns");
  Require(in.At() == 375, "end of the header");
  for (uint32_t i = 0; i < num_records; ++i) {
    in.Take<uint16_t>();
    Require(std::string(in.Bytes(16).c_str()) == "LASF_Projection" && in.Take<uint16_t>() == 2112, "record");
    const auto size = in.Take<uint16_t>();
    in.Bytes(32);
    const std::string text = in.Bytes(size);
    Require(!text.empty() && text.back() == '\0', "WKT ends with a zero");
    file.wkt = text.c_str();
  }
  Require(in.At() == points_at, "offset of the points");
  for (uint64_t i = 0; i < count; ++i) {
    LasPoint point;
    for (int axis = 0; axis < 3; ++axis) point.position[axis] = in.Take<int32_t>() * file.scale[axis] + offset[axis];
    in.Take<uint16_t>();
    point.returns = in.Take<uint8_t>();
    in.Bytes(2);
    point.user_data = in.Take<uint8_t>();
    in.Take<int16_t>();
    point.source = in.Take<uint16_t>();
    in.Take<double>();
    for (uint16_t& c : point.color) c = in.Take<uint16_t>();
    file.points.push_back(point);
  }
  Require(in.AtEnd(), "nothing follows the points");
  return file;
}

TEST(Las, PointsComeBackWithinAMillionthOfTheExtent) {
  const PlacedMap map = MakeTestMap();
  const LasFile file = Read(PointsLas(map));
  ASSERT_EQ(file.points.size(), 6u);
  Eigen::Vector3d low = map.points[0].position, high = low;
  for (size_t i = 0; i < 6; ++i) {
    EXPECT_LT((file.points[i].position - map.points[i].position).norm(), 1e-5);
    EXPECT_EQ(file.points[i].returns, 0x11);
    EXPECT_EQ(file.points[i].source, i < 3 ? 0 : 7) << "the number of the submap";
    EXPECT_EQ(file.points[i].user_data, i == 5 ? 255 : i + 1);
    EXPECT_EQ(file.points[i].color[0], 257 * 40 * i);
    EXPECT_EQ(file.points[i].color[2], 65535);
    low = low.cwiseMin(file.points[i].position);
    high = high.cwiseMax(file.points[i].position);
  }
  EXPECT_LT((file.high - file.points[5].position.cwiseMax(file.points[0].position)).norm(), 1e-9);
  EXPECT_LT((file.low - file.points[5].position.cwiseMin(file.points[0].position)).norm(), 1e-9);
  EXPECT_EQ(file.system, "images, unit arbitrary");
  EXPECT_TRUE(file.wkt.empty());
  EXPECT_EQ(file.encoding & 16, 16) << "point format 7 needs the bit of WKT";
  EXPECT_EQ(file.year, 2023);
  EXPECT_EQ(file.day, 318) << "14 November";
}

TEST(Las, TheReferenceSystemIsInItAndCoordinatesAreFull) {
  const LasFile file = Read(PointsLas(MakeUtmMap()));
  EXPECT_NEAR(file.points[1].position.x(), 598765 + 2.1234567, 1e-5);
  EXPECT_NEAR(file.points[1].position.y(), 5912345 - 1, 1e-5);
  EXPECT_NEAR(file.points[1].position.z(), 120.01, 1e-5);
  EXPECT_EQ(file.wkt.find("PROJCS[\"WGS 84 / UTM zone 30N\""), 0u) << file.wkt;
  EXPECT_NE(file.wkt.find("PARAMETER[\"central_meridian\",-3]"), std::string::npos);
  EXPECT_EQ(std::count(file.wkt.begin(), file.wkt.end(), '['), std::count(file.wkt.begin(), file.wkt.end(), ']'));
  EXPECT_EQ(file.system, "images");
}

TEST(Las, OfNoPointsThereIsAFileToo) { EXPECT_TRUE(Read(PointsLas(PlacedMap())).points.empty()); }

TEST(Wkt, SouthernZonesAndUnknownCodes) {
  EXPECT_NE(WellKnownText(32756).find("UTM zone 56S"), std::string::npos);
  EXPECT_NE(WellKnownText(32756).find("\"false_northing\",10000000"), std::string::npos);
  EXPECT_THROW(WellKnownText(31467), std::runtime_error);
}

}  // namespace las_test
}  // namespace mapmend
