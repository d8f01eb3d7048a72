// SIGKILLs of the store while a flight is replayed and merged: nothing acknowledged is lost, nothing comes twice, and
// stream and merged map are bit for bit those of the flight that nobody disturbed. MAPMEND_KILLS: how many (default
// 100).

#include <gtest/gtest.h>
#include <spdlog/spdlog.h>

#include <cstdlib>
#include <random>

#include "libs/wire/stream_sender.h"
#include "procs/submap_store/database.h"
#include "tests/process/command_helper.h"
#include "tests/process/store_helper.h"

namespace mapmend {
namespace store_kills_test {

const std::string kFlight = std::string(MAPMEND_SOURCE_DIR) + "/data/flights/sheffield_cross/";
const std::string kVocabulary = std::string(MAPMEND_SOURCE_DIR) + "/data/vocabulary/mapmend.voc";

// The end of the first flight and the beginning of the second, which crosses it: submaps that are merged.
std::vector<std::string> RunArguments(const std::string& out) {
  return {ProgramPath("mapmend"),
          "run",
          kFlight + "video.mp4",
          "--skip-frames",
          "0-39,74-83,131-171",
          "--seed",
          "1",
          "--port",
          "0",
          "--out",
          out};
}

// What a replaying process may do and has done, in memory shared with the test.
struct ReplayState {
  volatile int64_t allowed = -1;       // last record that it may send now
  volatile int64_t acknowledged = -1;  // last record that the store has acknowledged
};

std::vector<EncodedRecord> ReadRecording(const std::string& db, SessionRow* session) {
  std::vector<EncodedRecord> records;
  Database database(db, Database::Mode::kReadOnly);
  *session = database.Sessions().at(0);
  database.ReadRecords(*session, 0, session->cumulative, [&](EncodedRecord record) {
    records.push_back(std::move(record));
    return true;
  });
  return records;
}

// Sends a recorded flight as its frontend did, as far as it is allowed to.
void Replay(const std::vector<EncodedRecord>& records, const std::string& url, const std::string& outbox,
            ReplayState* state) {
  spdlog::set_level(spdlog::level::off);
  Bus bus(url, "");
  StreamSenderOptions options;
  options.outbox_path = outbox;
  StreamSender sender(&bus, records.front().session, options);
  size_t next = 0;
  do {
    if (next < records.size() && static_cast<int64_t>(next) <= state->allowed) {
      const EncodedRecord& record = records[next++];
      DecodedRecord decoded = DecodeRecord(record.channel, record.data.data(), static_cast<int>(record.data.size()));
      sender.Append(decoded.record->header.utime, std::move(decoded.record->body));
    }
    PauseMs(2);
    state->acknowledged = sender.AcknowledgedSeq();
  } while (next < records.size() || sender.AcknowledgedSeq() < sender.LastSeq());
}

TEST(StoreKills, TheMergedMapIsThatOfAnUndisturbedFlight) {
  const TemporaryFolder folder;
  ASSERT_EQ(RunCommand(RunArguments(folder / "undisturbed"), kPatienceS).exit_code, 0);
  const auto hash = [&](const std::string& db) {
    return RunProgram({ProgramPath("mapmend"), "db", "hash", db}, folder / "hash.txt").output;
  };
  const std::string expected = hash(folder / "undisturbed/map.db");
  ASSERT_NE(expected.find("map "), std::string::npos) << expected;
  ASSERT_EQ(expected.find("none"), std::string::npos) << expected;
  SessionRow session;
  const std::vector<EncodedRecord> records = ReadRecording(folder / "undisturbed/map.db", &session);
  ASSERT_GT(records.size(), 100u);

  const std::string db = folder / "map.db", log = folder / "log.txt";
  const int port = AnyFreePort();
  TestProcess hub = StartHub(port, log);
  TestProcess store = StartStore(db, port, log);
  TestProcess merger({ProgramPath("merger"), "--vocabulary", kVocabulary, "--seed", "1", "--lcm-url", HubUrl(port)},
                     log);
  auto* state = MapShared<ReplayState>();
  TestProcess frontend([&] { Replay(records, HubUrl(port), folder / "outbox", state); });
  const auto committed = [&] {
    Database database(db, Database::Mode::kReadOnly);
    const auto sessions = database.Sessions();
    return sessions.empty() ? -1 : sessions.front().cumulative;
  };

  const char* setting = std::getenv("MAPMEND_KILLS");
  const int num_kills = setting == nullptr ? 100 : std::atoi(setting);
  std::mt19937 random(5);
  int num_with_progress = 0;
  for (int i = 0; i < num_kills; ++i) {
    const int64_t before = state->acknowledged;
    state->allowed = static_cast<int64_t>(records.size()) * (i + 1) / num_kills - 1;
    // Every other kill comes soon after the store has begun to commit, the others whenever they come.
    if (i % 2 == 1) PollUntil([&] { return state->acknowledged > before; }, 2000);
    PauseMs(static_cast<int>(random() % (i % 2 == 1 ? 60 : 200)));
    const int64_t acknowledged = state->acknowledged;
    store.Kill();
    if (acknowledged >= 0) {
      ASSERT_GE(committed(), acknowledged) << "kill " << i;
    }
    if (acknowledged > before) ++num_with_progress;
    store = StartStore(db, port, log);
  }
  EXPECT_GT(num_with_progress, num_kills / 4);  // the kills hit a store that was at work
  EXPECT_EQ(frontend.Wait(60000), 0);
  EXPECT_TRUE(merger.IsRunning());
  const auto is_final = [&] {
    Database database(db, Database::Mode::kReadOnly);
    return database.Sql().execAndGet("SELECT ifnull(max(final), 0) FROM revision").getInt() != 0 &&
           hash(db).find("none") == std::string::npos;
  };
  // The merger's parts follow the revision: the hash is that of the newest complete one.
  EXPECT_TRUE(PollUntil([&] { return is_final() && hash(db) == expected; }, 120000)) << hash(db) << expected;
  EXPECT_EQ(merger.Terminate(), 0);
  EXPECT_EQ(store.Terminate(), 0);
  EXPECT_EQ(hash(db), expected);
  const TestOutput check = RunProgram({ProgramPath("mapmend"), "db", "check", db}, folder / "check.txt");
  EXPECT_EQ(check.exit_code, 0) << check.output;
  Database database(db, Database::Mode::kReadOnly);
  EXPECT_EQ(database.Sql().execAndGet("SELECT count(*) FROM record").getInt64(), static_cast<int64_t>(records.size()));
  EXPECT_TRUE(database.Gaps(1).empty());
}

}  // namespace store_kills_test
}  // namespace mapmend
