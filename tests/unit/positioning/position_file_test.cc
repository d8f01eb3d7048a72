#include "libs/positioning/position_file.h"

#include <gtest/gtest.h>

#include <filesystem>
#include <fstream>

#include "libs/positioning/position_source.h"
#include "tests/scratch_folder.h"

namespace mapmend {
namespace position_file_test {

class PositionFileTest : public ::testing::Test {
 protected:
  std::string Write(const std::string& text, const std::string& name = "positions.txt") {
    const std::string path = folder_.Path() + "/" + name;
    std::ofstream(path, std::ios::binary) << text;
    return path;
  }
  PositionFile Read(const std::string& text) { return ReadPositions(Write(text)); }
  std::string ErrorOf(const std::string& text) {
    try {
      Read(text);
    } catch (const std::runtime_error& e) {
      return e.what();
    }
    return "";
  }

  ScratchFolder folder_;
};

TEST_F(PositionFileTest, OfTheSimulator) {
  const PositionFile file = Read(
      "time_s,latitude_deg,longitude_deg,altitude_m,sigma_horizontal_m,sigma_vertical_m\n"
      "0.000,34.03000000,108.76000000,610.5,1.5,3\n"
      "1.000,34.03001000,108.76001000,610.6,1.5,3\n");
  ASSERT_EQ(file.fixes.size(), 2u);
  EXPECT_EQ(file.fixes[1].utime, 1000000);
  EXPECT_DOUBLE_EQ(file.fixes[1].latitude_deg, 34.03001);
  EXPECT_DOUBLE_EQ(file.fixes[1].longitude_deg, 108.76001);
  EXPECT_DOUBLE_EQ(file.fixes[1].altitude_m, 610.6);
  EXPECT_DOUBLE_EQ(file.fixes[1].sigma_horizontal_m, 1.5);
  EXPECT_DOUBLE_EQ(file.fixes[1].sigma_vertical_m, 3);
  EXPECT_TRUE(file.names.empty());
}

TEST_F(PositionFileTest, OfTheBundledFlight) {
  const PositionFile file = ReadPositions(std::string(MAPMEND_SOURCE_DIR) + "/data/flights/sheffield_cross/exif.csv");
  ASSERT_EQ(file.fixes.size(), 172u);
  EXPECT_TRUE(file.refused.empty());
  EXPECT_EQ(file.fixes[0].utime, 1525003606000000);  // the first line of times.txt
  EXPECT_DOUBLE_EQ(file.fixes[0].latitude_deg, 28.0412532222222);
  EXPECT_DOUBLE_EQ(file.fixes[0].altitude_m, -5.677);
  EXPECT_NEAR(file.fixes[0].yaw_deg, 92.5, 1e-6);
  EXPECT_NEAR(file.fixes[0].pitch_deg, -75.1, 1e-3);
  EXPECT_EQ(file.names[0], "DJI_0054.JPG");
}

TEST_F(PositionFileTest, OfExiftoolWithDegreesAndWords) {
  const PositionFile file = Read(
      "SourceFile;DateTimeOriginal;GPSLatitude;GPSLongitude;GPSAltitude\r\n"
      "a.jpg;2018:04:29 12:06:46+02:00;\"28 deg 2' 28.51\"\" N\";\"82 deg 41' 54.51\"\" W\";\"5.7 m Below Sea "
      "Level\"\r\n");
  ASSERT_EQ(file.fixes.size(), 1u);
  EXPECT_NEAR(file.fixes[0].latitude_deg, 28 + 2 / 60.0 + 28.51 / 3600, 1e-9);
  EXPECT_NEAR(file.fixes[0].longitude_deg, -(82 + 41 / 60.0 + 54.51 / 3600), 1e-9);
  EXPECT_DOUBLE_EQ(file.fixes[0].altitude_m, -5.7);
  EXPECT_EQ(file.fixes[0].utime, 1525003606000000 - int64_t{7200} * 1000000);
}

TEST_F(PositionFileTest, BadFixesAreRefusedOneByOneWithTheirLines) {
  const PositionFile file = Read(
      "time,lat,lon,alt\n"
      "100,50.0,8.0,100\n"
      "101,0,0,0\n"
      "102,50.00001,8.0,100\n"
      "103,95,8.0,100\n"
      "104,50.1,8.0,100\n"
      "105,abc,8.0,100\n"
      "105,50.00002,8.0,\n"
      "105,50.00002,8.0,100\n"
      "107,50.00003,8.0,100\n");
  ASSERT_EQ(file.fixes.size(), 4u);
  ASSERT_EQ(file.refused.size(), 5u);
  EXPECT_EQ(file.refused[0], "line 3: latitude 0, longitude 0: the receiver had no fix");
  EXPECT_EQ(file.refused[1], "line 5: latitude 95, longitude 8: not on the earth");
  EXPECT_EQ(file.refused[2].substr(0, 22), "line 6: a jump of 1113");
  EXPECT_EQ(file.refused[3], "line 7: no position");
  EXPECT_EQ(file.refused[4], "line 9: its time is not later than that of the fix before");
  EXPECT_FALSE(file.fixes[2].HasAltitude());
}

TEST_F(PositionFileTest, AWrongFirstFixDoesNotKeepTheOthersOut) {
  const PositionFile file = Read("t,lat,lon\n1,10,10\n2,50,8\n3,50,8.00001\n4,50,8.00002\n5,50,8.00003\n");
  ASSERT_EQ(file.fixes.size(), 3u);
  EXPECT_EQ(file.fixes.back().utime, 5000000);
}

TEST_F(PositionFileTest, Gpx) {
  const PositionFile file = Read(
      "<?xml version=\"1.0\"?>\n<gpx xmlns=\"http://www.topografix.com/GPX/1/1\"><trk><trkseg>\n"
      "<trkpt lat=\"47.1\" lon=\"-8.5\"><ele>431.5</ele><time>2024-05-01T10:00:00.250Z</time></trkpt>\n"
      "<trkpt lat=\"47.10001\" lon=\"-8.5\"><time>soon</time></trkpt>\n"
      "</trkseg></trk></gpx>\n");
  ASSERT_EQ(file.fixes.size(), 1u);
  EXPECT_EQ(file.fixes[0].utime, 1714557600250000);
  EXPECT_DOUBLE_EQ(file.fixes[0].altitude_m, 431.5);
  EXPECT_DOUBLE_EQ(file.fixes[0].longitude_deg, -8.5);
  EXPECT_EQ(file.refused, std::vector<std::string>{"line 4: \"soon\" is not a time"});
  EXPECT_EQ(file.format, "GPX");
}

TEST_F(PositionFileTest, Nmea) {
  const PositionFile file = Read(
      "$GPGGA,235959.00,4807.038,N,01131.000,E,1,08,0.9,545.4,M,46.9,M,,\n"
      "$GPRMC,000000.00,A,4807.038,N,01131.000,E,010.0,084.4,240394,003.1,W\n"
      "$GPGGA,000001.00,4807.039,N,01131.000,W,1,08,0.9,545.5,M,46.9,M,,*00\n"
      "$GPGGA,000002.00,4807.039,S,01131.000,E,0,00,,,M,,M,,\n"
      "$GNGGA,000003.50,4807.040,N,01131.000,E,4,12,0.6,545.6,M,46.9,M,,\n");
  ASSERT_EQ(file.fixes.size(), 2u);
  EXPECT_NEAR(file.fixes[0].latitude_deg, 48 + 7.038 / 60, 1e-9);
  EXPECT_EQ(file.fixes[1].utime - file.fixes[0].utime, 4500000);  // across midnight
  EXPECT_EQ(file.fixes[1].utime, 764467203500000);
  ASSERT_EQ(file.refused.size(), 2u);
  EXPECT_EQ(file.refused[0], "line 3: its checksum does not fit");
  EXPECT_EQ(file.refused[1], "line 4: the receiver had no fix");
}

TEST_F(PositionFileTest, SubtitlesOfNewAndOldCameras) {
  const PositionFile file = Read(
      "1\n00:00:00,000 --> 00:00:00,033\n<font size=\"28\">FrameCnt: 1\n[iso: 100] [latitude: 47.1] [longitude: 8.5] "
      "[rel_alt: 1.3 abs_alt: 431.5] </font>\n\n"
      "2\n00:00:01,500 --> 00:00:01,533\nGPS(8.50001,47.10001,18) BAROMETER:12.5\n\n"
      "3\n00:00:02,500 --> 00:00:02,533\nF/2.8, SS 206\n");
  ASSERT_EQ(file.fixes.size(), 2u);
  EXPECT_TRUE(file.since_first_frame);
  EXPECT_DOUBLE_EQ(file.fixes[0].altitude_m, 431.5);
  EXPECT_EQ(file.fixes[1].utime, 1500000);
  EXPECT_DOUBLE_EQ(file.fixes[1].latitude_deg, 47.10001);
  EXPECT_DOUBLE_EQ(file.fixes[1].altitude_m, 12.5);
  EXPECT_EQ(file.refused, std::vector<std::string>{"line 11: tells no position"});
}

TEST_F(PositionFileTest, GeoTxtInDegreesAndOnTheGrid) {
  const PositionFile degrees = Read("EPSG:4326\nDJI_1.JPG -82.69 28.04 70.5\nDJI_2.JPG -82.69 28.04\nDJI_3.JPG\n");
  ASSERT_EQ(degrees.fixes.size(), 2u);
  EXPECT_FALSE(degrees.has_times);
  EXPECT_EQ(degrees.names[0], "DJI_1.JPG");
  EXPECT_DOUBLE_EQ(degrees.fixes[0].latitude_deg, 28.04);
  EXPECT_EQ(degrees.refused.size(), 1u);
  const Geodetic place{28.04, -82.69, 0};
  const Eigen::Vector3d grid = UtmFrame(place).FromGeodetic(place);
  const PositionFile utm =
      Read("WGS84 UTM 17N\nDJI_1.JPG " + std::to_string(grid.x()) + " " + std::to_string(grid.y()) + " 70.5\n");
  ASSERT_EQ(utm.fixes.size(), 1u);
  EXPECT_NEAR(utm.fixes[0].latitude_deg, 28.04, 1e-8);
  EXPECT_NEAR(utm.fixes[0].longitude_deg, -82.69, 1e-8);
  EXPECT_NE(ErrorOf("EPSG:3857\na 1 2 3\n").find("EPSG:3857 is not read"), std::string::npos);
}

TEST_F(PositionFileTest, RowsOfEastNorthUpNeedAnOrigin) {
  const std::string rows = "1525003606.0 0 0 0 0 0 0 1\n1525003612.0 100 0 5 0 0 0 1\n";
  EXPECT_NE(ErrorOf(rows).find("--gps-origin"), std::string::npos);
  const PositionFile file = Read("# origin: 28.04 -82.69 3\n" + rows);
  ASSERT_EQ(file.fixes.size(), 2u);
  const Eigen::Vector3d enu =
      LocalFrame({28.04, -82.69, 3})
          .ToEnu({file.fixes[1].latitude_deg, file.fixes[1].longitude_deg, file.fixes[1].altitude_m});
  EXPECT_NEAR((enu - Eigen::Vector3d(100, 0, 5)).norm(), 0, 1e-6);
}

TEST_F(PositionFileTest, WhatCannotBeReadIsToldInOneLine) {
  for (const std::string text : {"hello\nworld\n", "", "a,b\n1,2\n", "<gpx", "<?xml version=\"1.0\"?><kml></kml>",
                                 "lat,lon\n1,2\n", "time,latitude\n1,2\n", "time,lat,lon\n1,0,0\n"}) {
    const std::string error = ErrorOf(text);
    EXPECT_NE(error.find("positions.txt"), std::string::npos) << text;
    EXPECT_EQ(error.find('\n'), std::string::npos) << error;
  }
  EXPECT_THROW(ReadPositions(folder_.Path() + "/none"), std::runtime_error);
}

TEST_F(PositionFileTest, AreHandedOutAsTheirTimeComes) {
  const std::string path = Write("t,lat,lon\n0.5,50,8\n1.0,50,8.00001\n1.5,50,8.00002\n9,50,8.00003\n");
  PositionSource source = PositionSource::Open(path, "", {"video.mp4"}, {});
  EXPECT_EQ(source.TakeFor(0, 0).size(), 0u);
  EXPECT_EQ(source.TakeFor(1, 1000000).size(), 2u);
  EXPECT_EQ(source.TakeFor(2, 2000000).size(), 1u);
  EXPECT_EQ(source.TakeRest().size(), 1u);
  PositionSource again = PositionSource::Open(path, "", {"video.mp4"}, {});
  again.PassOver(1000000);  // told by an earlier frontend
  EXPECT_EQ(again.TakeFor(2, 2000000).size(), 1u);
}

TEST_F(PositionFileTest, NamesTellTheFrame) {
  const std::string path = Write("EPSG:4326\nb.jpg 8 50\na.jpg 8.00001 50\n");
  PositionSource source = PositionSource::Open(path, "", {"photos"}, {"photos/a.jpg", "photos/b.jpg"});
  const std::vector<PositionFix> fixes = source.TakeFor(1, 77);
  ASSERT_EQ(fixes.size(), 1u);
  EXPECT_DOUBLE_EQ(fixes[0].longitude_deg, 8);
  EXPECT_EQ(fixes[0].utime, 77);
  EXPECT_THROW(PositionSource::Open(path, "", {"video.mp4"}, {}), std::runtime_error);
}

TEST_F(PositionFileTest, SubtitlesBesideTheVideoCountFromItsFirstFrame) {
  Write("1\n00:00:01,000 --> 00:00:01,033\n[latitude: 47.1] [longitude: 8.5]\n", "flight.SRT");
  PositionSource source = PositionSource::Open("", "", {folder_.Path() + "/flight.MP4"}, {});
  EXPECT_NE(source.Note().find("found beside the video"), std::string::npos);
  EXPECT_EQ(source.TakeFor(0, 5000000).size(), 0u);
  EXPECT_EQ(source.TakeFor(1, 6000000).size(), 1u);
  EXPECT_TRUE(PositionSource::Open("none", "", {folder_.Path() + "/flight.MP4"}, {}).IsEmpty());
  Write("1\n00:00:01,000 --> 00:00:01,033\nhello\n", "other.srt");
  EXPECT_TRUE(PositionSource::Open("", "", {folder_.Path() + "/other.mp4"}, {}).IsEmpty());
}

}  // namespace position_file_test
}  // namespace mapmend
