#include "procs/mapmend/log_reader.h"

#include <gtest/gtest.h>
#include <unistd.h>

#include <filesystem>
#include <fstream>
#include <lcm/lcm-cpp.hpp>

#include "libs/bus/bus.h"
#include "libs/bus/channels.h"
#include "libs/stream/submap.h"
#include "libs/wire/record_checksums.h"

namespace mapmend {
namespace log_reader_test {

const char kSessionId[] = "0a4b1f0e-3c55-4a5e-9d4e-2f6f6a1c0001";

std::vector<Record> MakeSession(int num_submaps = 1) {
  SessionStarted started;
  started.version = "0";
  started.source = "test";
  started.camera.fx = started.camera.fy = 100;
  started.camera.cx = started.camera.cy = 50;
  started.camera.width = started.camera.height = 100;
  started.pinhole = started.camera.Ideal();
  started.vocabulary_hash = "abcd";
  started.settings_json = "{}";
  std::vector<RecordBody> bodies = {started};
  for (int i = 0; i < num_submaps; ++i) {
    MapUpdate update;
    update.submap = SubmapId(i);
    bodies.push_back(SubmapStarted{SubmapId(i)});
    bodies.push_back(update);
    if (num_submaps > 1 && i == 0) bodies.push_back(update);
    bodies.push_back(SubmapEnded{SubmapId(i), "end_of_input", "", 5, 500});
  }
  bodies.push_back(SessionEnded{6});
  std::vector<Record> records;
  for (const RecordBody& body : bodies) {
    const auto seq = static_cast<int64_t>(records.size());
    records.push_back({{kSessionId, seq, 100 * (seq + 1)}, body});
  }
  return records;
}

class LogReaderTest : public testing::Test {
 protected:
  LogReaderTest() : path_(testing::TempDir() + "/log_reader_" + std::to_string(getpid()) + ".lcmlog") {}
  ~LogReaderTest() override { std::filesystem::remove(path_); }

  // Writes the records with these numbers, in this order, with a prefix before their channels.
  void WriteLog(const std::vector<int>& order, const std::string& prefix = "", int num_submaps = 1,
                bool with_checksums = true) {
    lcm::LogFile log(path_, "w");
    const auto records = MakeSession(num_submaps);
    RecordChecksums checksums;
    const auto write = [&](const std::string& channel, std::vector<uint8_t> data) {
      lcm::LogEvent event{};
      event.channel = channel;
      event.timestamp = time_++;
      event.datalen = static_cast<int>(data.size());
      event.data = data.data();
      log.writeEvent(&event);
    };
    for (const int index : order) {
      const EncodedRecord encoded = EncodeRecord(records[index]);
      if (with_checksums) write(prefix + channels::kChecksum, Encode(checksums.Of(encoded)));
      write(prefix + encoded.channel, encoded.data);
      write(prefix + channels::kHealth, {1, 2, 3});  // not of the stream
    }
  }
  static std::vector<int64_t> ReadAll(LogReader* reader) {
    std::vector<int64_t> numbers;
    while (const auto record = reader->Next()) numbers.push_back(record->seq);
    return numbers;
  }

  std::string path_;
  int64_t time_ = 1;
};

TEST_F(LogReaderTest, PutsRecordsInOrderAndDropsRepetitions) {
  WriteLog({0, 2, 1, 1, 4, 2, 3, 0}, "v1_");
  LogReader reader(path_);
  EXPECT_EQ(reader.VocabularyHash(), "abcd");
  EXPECT_EQ(reader.NumLeft(), 5);
  EXPECT_EQ(ReadAll(&reader), (std::vector<int64_t>{0, 1, 2, 3, 4}));
  EXPECT_EQ(reader.NumLeft(), 0);
  EXPECT_TRUE(reader.Complaints().empty());
  EXPECT_EQ(reader.LastRecords().at(kSessionId), 4);
}

TEST_F(LogReaderTest, ClosesASessionThatBreaksOff) {
  WriteLog({0, 1, 2});
  LogReader reader(path_);
  std::vector<Record> records;
  while (const auto encoded = reader.Next()) {
    const auto decoded = DecodeRecord(encoded->channel, encoded->data.data(), static_cast<int>(encoded->data.size()));
    ASSERT_TRUE(decoded.record) << decoded.error;
    records.push_back(*decoded.record);
  }
  ASSERT_EQ(records.size(), 5u);
  ASSERT_TRUE(std::holds_alternative<SubmapEnded>(records[3].body));
  EXPECT_EQ(std::get<SubmapEnded>(records[3].body).submap, SubmapId(0));
  EXPECT_EQ(records[3].header.seq, 3);
  EXPECT_TRUE(std::holds_alternative<SessionEnded>(records[4].body));
  ASSERT_EQ(reader.Complaints().size(), 1u);
  EXPECT_EQ(reader.Complaints()[0], std::string("session ") + kSessionId + " breaks off after record 2");
}

// 0 start, 1 and 5 submaps begin, 4 and 7 they end, 8 end.
TEST_F(LogReaderTest, BehindAHoleItGoesOnWithTheNextSubmap) {
  const std::vector<Record> flight = MakeSession(2);
  for (const int lost : {1, 2, 3, 4, 5, 6, 7}) {
    SCOPED_TRACE(lost);
    std::vector<int> order;
    for (int i = 0; i < static_cast<int>(flight.size()); ++i) {
      if (i != lost) order.push_back(i);
    }
    WriteLog(order, "", 2);
    LogReader reader(path_);
    int64_t last = -1;
    mapmend::Session model;
    while (const auto encoded = reader.Next()) {
      EXPECT_GT(encoded->seq, last);
      last = encoded->seq;
      const auto decoded = DecodeRecord(encoded->channel, encoded->data.data(), static_cast<int>(encoded->data.size()));
      ASSERT_TRUE(decoded.record) << decoded.error;
      EXPECT_EQ(model.Apply(*decoded.record), "") << encoded->seq;
    }
    EXPECT_TRUE(model.ended);
    EXPECT_EQ(model.submaps.size(), lost == 1 || lost == 5 ? 1u : 2u);
    for (const auto& [id, submap] : model.submaps) EXPECT_TRUE(submap.ended);
    ASSERT_FALSE(reader.Complaints().empty());
    EXPECT_NE(reader.Complaints()[0].find("record " + std::to_string(lost)), std::string::npos)
        << reader.Complaints()[0];
  }
}

TEST_F(LogReaderTest, RefusesWhatIsNoLog) {
  EXPECT_THROW(LogReader("/no/such/log"), std::runtime_error);
  std::ofstream(path_) << "text";
  EXPECT_THROW(LogReader{path_}, std::runtime_error);
  WriteLog({1, 2});
  EXPECT_THROW(LogReader{path_}, std::runtime_error);
}

// Each bit of a recording of a whole session, one after the other: what is read is the session, or the damage is told.
TEST_F(LogReaderTest, EveryFlippedBitIsToldOrDoesNotMatter) {
  const auto read = [&](std::vector<std::string>* complaints) {
    LogReader reader(path_);
    std::string stream;
    while (const auto record = reader.Next()) {
      stream += record->channel + std::to_string(record->seq) + std::string(record->data.begin(), record->data.end());
    }
    *complaints = reader.Complaints();
    return stream;
  };
  WriteLog({0, 1, 2, 3, 4});
  std::vector<std::string> complaints;
  const std::string whole = read(&complaints);
  EXPECT_TRUE(complaints.empty());
  std::ifstream file(path_, std::ios::binary);
  const std::string bytes(std::istreambuf_iterator<char>(file), {});
  int num_other = 0, num_told = 0;
  for (size_t bit = 0; bit < 8 * bytes.size(); bit += bit % 7 + 20) {
    std::string damaged = bytes;
    damaged[bit / 8] = static_cast<char>(damaged[bit / 8] ^ 1 << bit % 8);
    std::ofstream(path_, std::ios::binary | std::ios::trunc) << damaged;
    bool is_other = true, is_told = true;
    try {
      is_other = read(&complaints) != whole;
      is_told = !complaints.empty();
    } catch (const std::runtime_error&) {
    }
    num_other += is_other;
    num_told += is_told;
    ASSERT_FALSE(is_other && !is_told) << "bit " << bit;
  }
  EXPECT_GT(num_other, 100);
  EXPECT_GE(num_told, num_other);
}

TEST_F(LogReaderTest, ReadsOnBehindWhatIsNoEvent) {
  WriteLog({0, 1, 2, 3, 4});
  std::ifstream file(path_, std::ios::binary);
  const std::string bytes(std::istreambuf_iterator<char>(file), {});
  // The length of the third event, a health message, says 0x7fffffff; then it is torn out of the middle.
  size_t at = 0;
  for (int i = 0; i < 2; ++i) at = bytes.find("\xED\xA1\xDA\x01", at + 1);
  const size_t next = bytes.find("\xED\xA1\xDA\x01", at + 1);
  std::string endless = bytes;
  endless.replace(at + 24, 4, "\x7f\xff\xff\xff");
  const std::string torn = bytes.substr(0, at + 9) + bytes.substr(next);
  for (const std::string& damaged : {endless, torn}) {
    std::ofstream(path_, std::ios::binary | std::ios::trunc) << damaged;
    LogReader reader(path_);
    EXPECT_EQ(ReadAll(&reader), (std::vector<int64_t>{0, 1, 2, 3, 4}));
    ASSERT_EQ(reader.Complaints().size(), 1u);
    EXPECT_NE(reader.Complaints()[0].find("bytes from byte " + std::to_string(at)), std::string::npos)
        << reader.Complaints()[0];
  }
}

TEST_F(LogReaderTest, ReadsTheLogsOfOlderProgramsAndSaysSo) {
  WriteLog({0, 1, 2, 3, 4}, "", 1, false);
  LogReader reader(path_);
  EXPECT_FALSE(reader.HasChecksums());
  EXPECT_EQ(ReadAll(&reader), (std::vector<int64_t>{0, 1, 2, 3, 4}));
  EXPECT_TRUE(reader.Complaints().empty());
}

TEST_F(LogReaderTest, PutsPartsTogether) {
  const std::string folder = path_ + ".parts";
  std::filesystem::create_directory(folder);
  // Rotated: the newest part has the lowest number.
  const std::vector<std::vector<int>> parts = {{4}, {2, 3}, {0, 1}};
  for (size_t i = 0; i < parts.size(); ++i) {
    time_ = 1000 - 100 * static_cast<int64_t>(i);
    WriteLog(parts[i]);
    std::filesystem::rename(path_, folder + "/log." + std::to_string(i));
  }
  std::ofstream(folder + "/notes.txt") << "windy";
  const std::vector<std::string> found = FindLogs({folder});
  ASSERT_EQ(found.size(), 3u);
  EXPECT_TRUE(found[0].ends_with("log.2"));
  LogReader reader(found);
  EXPECT_EQ(ReadAll(&reader), (std::vector<int64_t>{0, 1, 2, 3, 4}));
  EXPECT_TRUE(reader.Complaints().empty());
  std::filesystem::remove_all(folder);
  std::filesystem::create_directory(folder);
  EXPECT_THROW(FindLogs({folder}), std::runtime_error);
  std::filesystem::remove_all(folder);
}

}  // namespace log_reader_test
}  // namespace mapmend
