#include <gtest/gtest.h>

#include <map>
#include <nlohmann/json.hpp>
#include <sstream>
#include <stdexcept>

#include "libs/base/checksum.h"
#include "libs/formats/base64.h"
#include "libs/formats/map_mcap.h"
#include "libs/formats/mcap_writer.h"
#include "tests/unit/formats/byte_reader.h"
#include "tests/unit/formats/test_map.h"

namespace mapmend {
namespace mcap_test {

using Json = nlohmann::json;

void Require(bool holds, const std::string& what) {
  if (!holds) throw std::runtime_error(what);
}

struct Message {
  uint64_t time = 0;
  uint32_t sequence = 0;
  std::string data;
};

// Reads a whole container and checks that everything that is told twice agrees.
class McapReader {
 public:
  explicit McapReader(const std::string& bytes) : bytes_(bytes) {
    const std::string magic("\x89MCAP0\r\n", 8);
    Require(bytes.size() > 16 && bytes.substr(0, 8) == magic && bytes.substr(bytes.size() - 8) == magic, "magic");
    ByteReader in(bytes, 8);
    while (ReadRecord(&in)) {
    }
    Require(in.At() == bytes.size() - 8, "footer is the last record");
    Require(told_messages_ == num_messages_, "statistics: messages");
    Require(told_chunks_ == num_chunks_ && indexed_chunks_ == num_chunks_, "chunk indexes");
  }

  std::vector<Message> Topic(const std::string& topic) const {
    for (const auto& [id, channel] : channels_) {
      if (channel.first == topic) return messages_.at(id);
    }
    throw std::runtime_error("no topic " + topic);
  }
  std::string SchemaOf(const std::string& topic) const {
    for (const auto& [id, channel] : channels_) {
      if (channel.first == topic) return schemas_.at(channel.second);
    }
    return {};
  }
  size_t NumChunks() const { return num_chunks_; }

 private:
  // False after the footer.
  bool ReadRecord(ByteReader* in) {
    const size_t start = in->At();
    const auto op = in->Take<uint8_t>();
    ByteReader r(in->Bytes(in->Take<uint64_t>()));
    switch (op) {
      case 0x01:
        r.Text(), r.Text();
        break;
      case 0x02:
        ReadFooter(&r, start);
        return false;
      case 0x03:
        ReadSchema(&r);
        break;
      case 0x04:
        ReadChannel(&r);
        break;
      case 0x05:
        ReadMessage(&r);
        return true;
      case 0x06:
        ReadChunk(&r, start);
        return true;
      case 0x07:
        ReadMessageIndex(&r);
        break;
      case 0x08:
        ReadChunkIndex(&r);
        break;
      case 0x0b:
        told_messages_ = r.Take<uint64_t>();
        Require(r.Take<uint16_t>() == schemas_.size() && r.Take<uint32_t>() == channels_.size(), "statistics");
        r.Bytes(8);
        told_chunks_ = r.Take<uint32_t>();
        r.Bytes(16);
        r.Text();
        break;
      case 0x0e:
        ReadSummaryOffset(&r);
        break;
      case 0x0f:
        data_end_ = in->At();
        r.Take<uint32_t>();
        break;
      default:
        throw std::runtime_error("unknown record");
    }
    Require(r.AtEnd(), "record " + std::to_string(op) + " is longer than what is in it");
    return true;
  }

  void ReadFooter(ByteReader* r, size_t start) {
    Require(r->Take<uint64_t>() == data_end_, "summary begins behind the data");
    Require(r->Take<uint64_t>() == offsets_start_, "summary offsets");
    const std::string covered = bytes_.substr(data_end_, start + 9 + 16 - data_end_);
    Require(r->Take<uint32_t>() == Crc32(covered.data(), covered.size()), "checksum of the summary");
  }
  void ReadSchema(ByteReader* r) {
    const auto id = r->Take<uint16_t>();
    const std::string name = r->Text();
    Require(r->Text() == "jsonschema" && id > 0, "schema encoding");
    const Json schema = Json::parse(r->Text());
    Require(schema.at("title") == name && schema.at("type") == "object", "schema");
    const auto it = schemas_.emplace(id, name).first;
    Require(it->second == name, "a schema told twice is the same");
  }
  void ReadChannel(ByteReader* r) {
    const auto id = r->Take<uint16_t>(), schema = r->Take<uint16_t>();
    const std::string topic = r->Text();
    Require(r->Text() == "json" && schemas_.contains(schema), "channel");
    r->Text();
    channels_.emplace(id, std::pair(topic, schema));
  }
  void ReadMessage(ByteReader* r) {
    const auto channel = r->Take<uint16_t>();
    Require(channels_.contains(channel), "channel of a message");
    Message message;
    message.sequence = r->Take<uint32_t>();
    message.time = r->Take<uint64_t>();
    Require(r->Take<uint64_t>() == message.time, "publish time");
    std::string rest;
    while (!r->AtEnd()) rest += r->Bytes(1);
    message.data = rest;
    messages_[channel].push_back(message);
    ++num_messages_;
  }
  void ReadChunk(ByteReader* r, size_t start) {
    first_time_ = r->Take<uint64_t>();
    last_time_ = r->Take<uint64_t>();
    const auto size = r->Take<uint64_t>();
    const auto crc = r->Take<uint32_t>();
    Require(r->Text().empty() && r->Take<uint64_t>() == size, "no compression");
    chunk_ = r->Bytes(size);
    Require(r->AtEnd() && Crc32(chunk_.data(), chunk_.size()) == crc, "checksum of a chunk");
    ByteReader records(chunk_);
    while (!records.AtEnd()) ReadRecord(&records);
    chunk_starts_.push_back(start);
    ++num_chunks_;
  }
  void ReadMessageIndex(ByteReader* r) {
    const auto channel = r->Take<uint16_t>();
    ByteReader entries(r->Text());
    while (!entries.AtEnd()) {
      const auto time = entries.Take<uint64_t>();
      ByteReader record(chunk_, entries.Take<uint64_t>());
      Require(record.Take<uint8_t>() == 0x05, "an index points at a message");
      record.Take<uint64_t>();
      Require(record.Take<uint16_t>() == channel, "of its channel");
      record.Take<uint32_t>();
      Require(record.Take<uint64_t>() == time && time >= first_time_ && time <= last_time_, "of its time");
    }
  }
  void ReadChunkIndex(ByteReader* r) {
    r->Bytes(16);
    const auto start = r->Take<uint64_t>(), length = r->Take<uint64_t>();
    Require(start == chunk_starts_.at(indexed_chunks_++), "start of a chunk");
    ByteReader offsets(r->Text());
    Require(r->Take<uint64_t>() > 0 && r->Text().empty(), "length of the indexes");
    r->Bytes(16);
    ByteReader first(bytes_, start + length);
    Require(first.Take<uint8_t>() == 0x07, "indexes follow their chunk");
    while (!offsets.AtEnd()) {
      const auto channel = offsets.Take<uint16_t>();
      ByteReader index(bytes_, offsets.Take<uint64_t>());
      Require(index.Take<uint8_t>() == 0x07, "offset of an index");
      index.Take<uint64_t>();
      Require(index.Take<uint16_t>() == channel, "channel of an index");
    }
  }
  void ReadSummaryOffset(ByteReader* r) {
    const auto op = r->Take<uint8_t>();
    const auto start = r->Take<uint64_t>(), length = r->Take<uint64_t>();
    Require(bytes_.at(start) == static_cast<char>(op), "group of the summary");
    offsets_start_ = start + length;
  }

  const std::string bytes_;
  std::map<uint16_t, std::string> schemas_;
  std::map<uint16_t, std::pair<std::string, uint16_t>> channels_;  // topic, schema
  std::map<uint16_t, std::vector<Message>> messages_;
  std::string chunk_;
  std::vector<size_t> chunk_starts_;
  size_t num_messages_ = 0, num_chunks_ = 0, indexed_chunks_ = 0, told_messages_ = 0, told_chunks_ = 0;
  uint64_t data_end_ = 0, offsets_start_ = 0, first_time_ = 0, last_time_ = 0;
};

McapReader ReadMap(const PlacedMap& map) {
  std::ostringstream stream;
  WriteMcap(map, &stream);
  return McapReader(stream.str());
}

TEST(Mcap, EveryTopicHasItsSchemaAndItsMessages) {
  const McapReader file = ReadMap(MakeTestMap());
  for (const auto& [topic, schema, count] :
       {std::tuple("/map/points", "PointCloud", 1u), std::tuple("/map/path", "PosesInFrame", 1u),
        std::tuple("/map/graph", "SceneUpdate", 1u), std::tuple("/map/camera", "PoseInFrame", 6u),
        std::tuple("/tf", "FrameTransform", 6u), std::tuple("/camera/info", "CameraCalibration", 6u),
        std::tuple("/log", "Log", 2u)}) {
    EXPECT_EQ(file.Topic(topic).size(), count) << topic;
    EXPECT_EQ(file.SchemaOf(topic), std::string("foxglove.") + schema);
  }
}

TEST(Mcap, PointsAreThoseOfTheMap) {
  const Json cloud = Json::parse(ReadMap(MakeTestMap()).Topic("/map/points").at(0).data);
  EXPECT_EQ(cloud.at("frame_id"), "map");
  EXPECT_EQ(cloud.at("point_stride"), 16);
  EXPECT_EQ(cloud.at("fields").at(2), Json({{"name", "z"}, {"offset", 8}, {"type", 7}}));
  EXPECT_EQ(cloud.at("fields").at(5), Json({{"name", "blue"}, {"offset", 14}, {"type", 1}}));
  EXPECT_EQ(cloud.at("data").get<std::string>().size(), 128u) << "6 points of 16 bytes";
}

TEST(Mcap, TheCameraMovesInTheTimeOfTheImages) {
  const PlacedMap map = MakeTestMap();
  const McapReader file = ReadMap(map);
  const auto poses = file.Topic("/tf");
  for (size_t i = 0; i < poses.size(); ++i) {
    EXPECT_EQ(poses[i].time, static_cast<uint64_t>(map.frames[i].utime) * 1000);
    EXPECT_EQ(poses[i].sequence, i);
    const Json pose = Json::parse(poses[i].data);
    EXPECT_EQ(pose.at("timestamp").at("nsec"), map.frames[i].utime % 1000000 * 1000);
    EXPECT_EQ(pose.at("parent_frame_id"), "map");
    EXPECT_EQ(pose.at("translation").at("x"), 2.0 * i);
  }
  const Message loss = file.Topic("/log").at(1);
  EXPECT_EQ(loss.time, static_cast<uint64_t>(map.losses[0].utime) * 1000);
  EXPECT_EQ(Json::parse(loss.data).at("level"), 3);
}

TEST(Mcap, ManyMessagesMakeSeveralChunks) {
  std::ostringstream stream;
  McapWriter writer(&stream);
  const uint16_t a = writer.AddChannel("/a", "S", R"({"type":"object","title":"S"})");
  const uint16_t b = writer.AddChannel("/b", "S", R"({"type":"object","title":"S"})");
  const std::string large = "{\"x\":\"" + std::string(1 << 20, 'x') + "\"}";
  for (int i = 0; i < 9; ++i) writer.AddMessage(i % 3 == 0 ? b : a, 1000 - i, large);
  writer.Finish();
  const McapReader file(stream.str());
  EXPECT_EQ(file.NumChunks(), 3u);
  EXPECT_EQ(file.Topic("/a").size(), 6u);
  EXPECT_EQ(file.Topic("/b").at(2).data, large);
}

TEST(Mcap, OfAnEmptyMapThereIsAFileToo) { EXPECT_EQ(ReadMap(PlacedMap()).Topic("/map/points").size(), 1u); }

TEST(Base64, IsThatOfTheRfc) {
  EXPECT_EQ(Base64(""), "");
  EXPECT_EQ(Base64("f"), "Zg==");
  EXPECT_EQ(Base64("fo"), "Zm8=");
  EXPECT_EQ(Base64("foo"), "Zm9v");
  EXPECT_EQ(Base64("foobar"), "Zm9vYmFy");
  EXPECT_EQ(Base64("\xff\xfe\xfd"), "//79");
}

}  // namespace mcap_test
}  // namespace mapmend
