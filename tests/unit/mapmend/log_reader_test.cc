#include "procs/mapmend/log_reader.h"

#include <gtest/gtest.h>
#include <unistd.h>

#include <filesystem>
#include <fstream>
#include <lcm/lcm-cpp.hpp>

#include "libs/bus/channels.h"

namespace mapmend {
namespace {

const char kSessionId[] = "0a4b1f0e-3c55-4a5e-9d4e-2f6f6a1c0001";

std::vector<Record> MakeSession() {
  SessionStarted started;
  started.version = "0";
  started.source = "test";
  started.camera.fx = started.camera.fy = 100;
  started.camera.cx = started.camera.cy = 50;
  started.camera.width = started.camera.height = 100;
  started.pinhole = started.camera.Ideal();
  started.vocabulary_hash = "abcd";
  started.settings_json = "{}";
  MapUpdate update;
  update.submap = SubmapId(0);
  const std::vector<RecordBody> bodies = {started, SubmapStarted{SubmapId(0)}, update,
                                          SubmapEnded{SubmapId(0), "end_of_input", "", 5, 500}, SessionEnded{6}};
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
  void WriteLog(const std::vector<int>& order, const std::string& prefix = "") {
    lcm::LogFile log(path_, "w");
    const auto records = MakeSession();
    const auto write = [&](const std::string& channel, std::vector<uint8_t> data) {
      lcm::LogEvent event{};
      event.channel = channel;
      event.datalen = static_cast<int>(data.size());
      event.data = data.data();
      log.writeEvent(&event);
    };
    for (const int index : order) {
      const EncodedRecord encoded = EncodeRecord(records[index]);
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
};

TEST_F(LogReaderTest, PutsRecordsInOrderAndDropsRepetitions) {
  WriteLog({0, 2, 1, 1, 4, 2, 3, 0}, "v1_");
  LogReader reader(path_);
  EXPECT_EQ(reader.VocabularyHash(), "abcd");
  EXPECT_EQ(ReadAll(&reader), (std::vector<int64_t>{0, 1, 2, 3, 4}));
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

TEST_F(LogReaderTest, StopsAtAHole) {
  WriteLog({0, 1, 3, 4});
  LogReader reader(path_);
  EXPECT_EQ(ReadAll(&reader), (std::vector<int64_t>{0, 1, 2, 3}));  // 2 and 3 close submap and session
  ASSERT_EQ(reader.Complaints().size(), 1u);
  EXPECT_NE(reader.Complaints()[0].find("the log lacks the next one, 2 later ones"), std::string::npos);
}

TEST_F(LogReaderTest, RefusesWhatIsNoLog) {
  EXPECT_THROW(LogReader("/no/such/log"), std::runtime_error);
  std::ofstream(path_) << "text";
  EXPECT_THROW(LogReader{path_}, std::runtime_error);
  WriteLog({1, 2});
  EXPECT_THROW(LogReader{path_}, std::runtime_error);
}

}  // namespace
}  // namespace mapmend
