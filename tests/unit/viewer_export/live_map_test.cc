#include "procs/viewer_export/live_map.h"

#include <gtest/gtest.h>

#include <cstring>
#include <map>
#include <nlohmann/json.hpp>

#include "tests/test_flight.h"

namespace mapmend {
namespace live_map_test {

// The other direction of libs/formats/base64.
std::string FromBase64(const std::string& text) {
  static const std::string kDigits = "ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789+/";
  std::string bytes;
  unsigned bits = 0;
  int count = 0;
  for (const char c : text) {
    if (c == '=') break;
    bits = bits << 6 | static_cast<unsigned>(kDigits.find(c));
    count += 6;
    if (count >= 8) bytes += static_cast<char>(bits >> (count -= 8) & 0xff);
  }
  return bytes;
}

template <typename T>
T At(const std::string& bytes, size_t offset) {
  T value;
  std::memcpy(&value, bytes.data() + offset, sizeof(T));
  return value;
}

// A table as a page would have it: rows by number.
std::map<uint32_t, std::string> Rows(const LiveFeed& feed, const std::string& table, size_t row_size,
                                     int64_t since = 0) {
  const std::string text = feed.Since(since, 1 << 30).json;
  std::map<uint32_t, std::string> rows;
  if (text.empty()) return rows;
  const std::string bytes = FromBase64(nlohmann::json::parse(text)["rows"].value(table, ""));
  for (size_t at = 0; at < bytes.size(); at += 4 + row_size)
    rows[At<uint32_t>(bytes, at)] = bytes.substr(at + 4, row_size);
  return rows;
}

constexpr size_t kPoint = 20, kKeyframe = 44, kFrame = 24;

Eigen::Vector3f PositionOf(const std::string& row) { return {At<float>(row, 0), At<float>(row, 4), At<float>(row, 8)}; }

// A page that has followed a flight record by record.
struct Followed {
  MapModel model;
  LiveMap map;
  LiveFeed feed;

  explicit Followed(const TestFlight& flight) {
    for (const Record& record : flight.Records()) {
      EXPECT_EQ(model.Apply(record), "");
      map.OnRecord(record, model);
      map.Publish(model, &feed);
    }
  }
};

TEST(LiveMapTest, HasEveryKeyframeFrameAndPointInTheSubmapsFrame) {
  const TestFlight flight;
  const Followed page(flight);
  for (int s = 0; s < 2; ++s) {
    const Submap& submap = page.model.GetSession(flight.Key(s).session).submaps.at(SubmapId(s));
    const std::string key = "0:" + std::to_string(s);
    EXPECT_EQ(PageKey(page.model, flight.Key(s)), key);
    EXPECT_EQ(ParsePageKey(page.model, key), flight.Key(s));
    const auto points = Rows(page.feed, "points/" + key, kPoint);
    ASSERT_EQ(points.size(), submap.points.size());
    double squared = 0, expected = 0;
    for (const auto& [row, bytes] : points) {
      squared += PositionOf(bytes).squaredNorm();
      EXPECT_EQ(At<uint8_t>(bytes, 19), 1);
    }
    for (const auto& [id, point] : submap.points) expected += point.position.squaredNorm();
    EXPECT_NEAR(squared, expected, 1e-3 * expected);
    const auto keyframes = Rows(page.feed, "keyframes/" + key, kKeyframe);
    ASSERT_EQ(keyframes.size(), submap.keyframes.size());
    for (const auto& [row, bytes] : keyframes) {
      const SubmapKeyframe& keyframe = submap.keyframes.at(KeyframeId(At<int32_t>(bytes, 0)));
      EXPECT_EQ(At<int32_t>(bytes, 4), keyframe.frame);
      EXPECT_NEAR(At<float>(bytes, 12), keyframe.cam_from_submap.translation.x(), 1e-4);
    }
    EXPECT_EQ(Rows(page.feed, "frames/" + key, kFrame).size(), submap.frames.size());
  }
  for (const char* wrong : {"", "0", "0:", "1:0", "0:-1", "0:1x", ":", "x:1"})
    EXPECT_FALSE(ParsePageKey(page.model, wrong).submap.IsValid()) << wrong;
}

TEST(LiveMapTest, ARevisionThatMovesNothingTellsNothing) {
  const TestFlight flight;
  Followed page(flight);
  MapRevision revision = flight.Revision();
  for (int s = 0; s < 2; ++s) revision.refined.push_back(flight.Refinement(s));
  const int64_t before = page.feed.Version();
  const auto keyframes = Rows(page.feed, "keyframes/0:1", kKeyframe);
  ASSERT_TRUE(page.model.SetRevision(revision));
  page.map.OnRevision(page.model);
  page.map.Publish(page.model, &page.feed);
  EXPECT_TRUE(Rows(page.feed, "points/0:1", kPoint, before).empty());
  for (const auto& [row, bytes] : Rows(page.feed, "keyframes/0:1", kKeyframe, before)) {
    for (size_t at = 12; at < 40; at += 4) EXPECT_NEAR(At<float>(bytes, at), At<float>(keyframes.at(row), at), 1e-4);
  }
}

TEST(LiveMapTest, TheRefinedMapIsShownWhereItsPointsAre) {
  const TestFlight flight;
  Followed page(flight);
  MapRevision revision = flight.Revision();
  revision.refined.push_back(flight.Refinement(1));
  const MapPointId moved = revision.refined[0].points[0].id, dropped = revision.refined[0].points[1].id;
  revision.refined[0].points[0].position += Eigen::Vector3f(0, 0, 2);
  revision.refined[0].points.erase(revision.refined[0].points.begin() + 1);
  const int64_t before = page.feed.Version();
  ASSERT_TRUE(page.model.SetRevision(revision));
  page.map.OnRevision(page.model);
  page.map.Publish(page.model, &page.feed);
  const auto rows = Rows(page.feed, "points/0:1", kPoint, before);
  ASSERT_EQ(rows.size(), 2u) << "one has moved, one is left out: " << moved.value << ", " << dropped.value;
  int shown = 0;
  for (const auto& [row, bytes] : rows) {
    shown += At<uint8_t>(bytes, 19);
    if (At<uint8_t>(bytes, 19) == 0) continue;
    const Similarity3 root_from_submap = revision.transforms.submaps[1].root_from_submap;
    const Eigen::Vector3d in_root = root_from_submap * PositionOf(bytes).cast<double>();
    EXPECT_LT((in_root - revision.refined[0].points[0].position.cast<double>()).norm(), 1e-3);
  }
  EXPECT_EQ(shown, 1);
}

TEST(LiveMapTest, ACulledKeyframeGoesAndItsFramesFollowAnother) {
  const TestFlight flight;
  Followed page(flight);
  const Submap& submap = page.model.GetSession(flight.Key(0).session).submaps.at(SubmapId(0));
  // The flight has ended: a map in which a keyframe is culled is built anew, up to the end of submap 0.
  MapModel model;
  LiveMap map;
  LiveFeed feed;
  const KeyframeId culled = std::next(submap.keyframes.begin())->first;
  int64_t seq = 0;
  for (const Record& record : flight.Records()) {
    if (std::holds_alternative<SubmapEnded>(record.body)) break;
    ASSERT_EQ(model.Apply(record), "");
    map.OnRecord(record, model);
    seq = record.header.seq;
  }
  map.Publish(model, &feed);
  const int64_t before = feed.Version();
  MapUpdate update;
  update.submap = SubmapId(0);
  update.removed_keyframes.push_back(culled);
  const Record cull{{flight.Key(0).session, seq + 1, TestFlight::Utime(19)}, update};
  ASSERT_EQ(model.Apply(cull), "");
  map.OnRecord(cull, model);
  map.Publish(model, &feed);
  const auto keyframes = Rows(feed, "keyframes/0:0", kKeyframe, before);
  ASSERT_EQ(keyframes.size(), 1u);
  EXPECT_EQ(At<uint32_t>(keyframes.begin()->second, 40), 0u) << "not shown any more";
  for (const auto& [row, bytes] : Rows(feed, "frames/0:0", kFrame))
    EXPECT_NE(At<uint32_t>(bytes, 8), keyframes.begin()->first) << "frame " << At<int32_t>(bytes, 0);
}

}  // namespace live_map_test
}  // namespace mapmend
