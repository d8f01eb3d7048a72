// A map database on a disk that forgets: whatever changes what the file says is seen by `db check`.

#include <gtest/gtest.h>

#include <algorithm>
#include <filesystem>
#include <fstream>
#include <functional>
#include <lcm/lcm-cpp.hpp>
#include <optional>
#include <random>

#include "libs/base/checksum.h"
#include "libs/bus/bus.h"
#include "libs/wire/record_checksums.h"
#include "procs/submap_store/db_commands.h"
#include "tests/scratch_folder.h"
#include "tests/unit/submap_store/filled_db.h"

namespace mapmend {
namespace damage_test {

// Everything that the tables hold; nullopt if it cannot be read.
std::optional<std::string> Content(const std::string& path) {
  try {
    SQLite::Database database(path, SQLite::OPEN_READONLY);
    std::string content = database.execAndGet("PRAGMA user_version").getString();
    SQLite::Statement tables(database, "SELECT name, sql FROM sqlite_master ORDER BY name");
    while (tables.executeStep()) {
      const std::string name = tables.getColumn(0).getString();
      content += name + tables.getColumn(1).getString();
      if (name.starts_with("sqlite_") || name == "connection_revision") continue;
      SQLite::Statement rows(database, "SELECT * FROM " + name);
      while (rows.executeStep()) {
        for (int i = 0; i < rows.getColumnCount(); ++i) {
          content += static_cast<char>('0' + rows.getColumn(i).getType()) + rows.getColumn(i).getString() + "|";
        }
      }
    }
    return content;
  } catch (const std::exception&) {
    return std::nullopt;
  }
}

bool IsSeen(const std::string& path) {
  try {
    return !CheckDb(path).empty();
  } catch (const std::exception&) {
    return true;
  }
}

class Damage : public ::testing::Test {
 protected:
  Damage() {
    FillWithMap(db_);
    std::ifstream file(db_, std::ios::binary);
    bytes_.assign(std::istreambuf_iterator<char>(file), {});
    content_ = *Content(db_);
  }

  struct Counts {
    int changed = 0, seen = 0, changed_unseen = 0;
  };
  // Damages a copy many times, each time otherwise.
  Counts Try(int times, const std::function<void(int, std::string*)>& damage) {
    Counts counts;
    for (int i = 0; i < times; ++i) {
      std::string bytes = bytes_;
      damage(i, &bytes);
      std::ofstream(copy_, std::ios::binary | std::ios::trunc) << bytes;
      const bool changed = Content(copy_) != content_, seen = IsSeen(copy_);
      counts.changed += changed;
      counts.seen += seen;
      counts.changed_unseen += changed && !seen;
      EXPECT_FALSE(changed && !seen) << "damage " << i;
    }
    return counts;
  }

  ScratchFolder folder_;
  std::string db_ = folder_.File("map.db"), copy_ = folder_.File("copy.db"), bytes_, content_;
  std::mt19937_64 random_{3};
};

TEST_F(Damage, ASoundFileIsSound) { EXPECT_EQ(CheckDb(db_), std::vector<std::string>()); }

TEST_F(Damage, EveryFlippedBitThatChangesWhatTheFileSaysIsSeen) {
  const Counts counts = Try(300, [&](int, std::string* bytes) {
    (*bytes)[random_() % bytes->size()] ^= static_cast<char>(1 << random_() % 8);
  });
  EXPECT_GT(counts.changed, 150);
  RecordProperty("seen", counts.seen);
}

TEST_F(Damage, BurstsAreSeen) {
  const Counts counts = Try(100, [&](int, std::string* bytes) {
    const size_t at = random_() % (bytes->size() - 8);
    for (size_t i = 0; i < 8; ++i) (*bytes)[at + i] = static_cast<char>(random_());
  });
  EXPECT_GT(counts.changed, 40);
}

TEST_F(Damage, EachZeroedPageIsSeen) {
  constexpr size_t kPage = 4096;
  Try(static_cast<int>(bytes_.size() / kPage),
      [&](int page, std::string* bytes) { bytes->replace(static_cast<size_t>(page) * kPage, kPage, kPage, '\0'); });
}

TEST_F(Damage, TruncationsAreSeen) {
  const Counts counts = Try(50, [&](int, std::string* bytes) { bytes->resize(random_() % bytes->size()); });
  EXPECT_EQ(counts.seen, 50);
}

TEST_F(Damage, ChecksumsAreThoseOfZlib) {
  EXPECT_EQ(Crc32("123456789", 9), 0xcbf43926u);
  EXPECT_EQ(Crc32("6789", 4, Crc32("12345", 5)), 0xcbf43926u);
  const uint8_t payload[] = {1, 2};
  EXPECT_EQ(RecordChecksum("A", payload, 2), Crc32("A\0\1\2", 4));
  SQLite::Database database(db_, SQLite::OPEN_READONLY);
  SQLite::Statement row(database, "SELECT channel, payload, checksum FROM record WHERE seq = 3");
  ASSERT_TRUE(row.executeStep());
  EXPECT_EQ(RecordChecksum(row.getColumn(0).getString(), static_cast<const uint8_t*>(row.getColumn(1).getBlob()),
                           static_cast<size_t>(row.getColumn(1).getBytes())),
            row.getColumn(2).getInt64());
}

class Repair : public Damage {
 protected:
  // A recording of the flight, with or without some of its records.
  std::string Record(const std::vector<int64_t>& without = {}) {
    const std::string path = folder_.File("flight.lcmlog");
    lcm::LogFile log(path, "w");
    RecordChecksums checksums;
    for (const mapmend::Record& record : MakeSyntheticStream({})) {
      EncodedRecord encoded = EncodeRecord(record);
      if (std::count(without.begin(), without.end(), encoded.seq) > 0) continue;
      std::vector<uint8_t> message = Encode(checksums.Of(encoded));
      for (const auto& [channel, data] :
           {std::pair<std::string, std::vector<uint8_t>*>("v1_MAPMEND_CHECKSUM", &message),
            std::pair<std::string, std::vector<uint8_t>*>("v1_" + encoded.channel, &encoded.data)}) {
        lcm::LogEvent event{};
        event.channel = channel;
        event.datalen = static_cast<int>(data->size());
        event.data = data->data();
        log.writeEvent(&event);
      }
    }
    return path;
  }
  void Write(const std::string& bytes) { std::ofstream(copy_, std::ios::binary | std::ios::trunc) << bytes; }
  std::vector<std::string> AllKept() const {
    std::vector<std::string> kept;
    for (const auto& entry : std::filesystem::directory_iterator(folder_.Path())) {
      if (entry.path().string().find(".damaged") != std::string::npos) kept.push_back(entry.path().string());
    }
    return kept;
  }
};

TEST_F(Repair, ASoundFileStaysAsItIs) {
  Write(bytes_);
  EXPECT_TRUE(RepairDb(copy_, {}));
  std::ifstream file(copy_, std::ios::binary);
  EXPECT_TRUE(std::string(std::istreambuf_iterator<char>(file), {}) == bytes_);
}

// Whatever page is gone: from a recording all of the stream comes back, from a copy the merged map too.
TEST_F(Repair, EveryZeroedPageComesBack) {
  constexpr size_t kPage = 4096;
  const DbHash whole = HashDb(db_);
  const std::string log = Record();
  for (size_t page = 0; page < bytes_.size() / kPage; page += page == 0 ? 1 : 3) {
    SCOPED_TRACE(page);
    std::string bytes = bytes_;
    bytes.replace(page * kPage, kPage, kPage, '\0');
    Write(bytes);
    if (page == 0) {
      EXPECT_THROW(RepairDb(copy_, {log}), std::runtime_error);  // SQLite cannot open it at all
      continue;
    }
    RepairDb(copy_, {log});
    EXPECT_EQ(CheckDb(copy_), std::vector<std::string>());
    EXPECT_EQ(HashDb(copy_).stream, whole.stream);
    Write(bytes);
    EXPECT_TRUE(RepairDb(copy_, {db_}));
    EXPECT_EQ(CheckDb(copy_), std::vector<std::string>());
    EXPECT_EQ(HashDb(copy_).stream, whole.stream);
    EXPECT_EQ(HashDb(copy_).map, whole.map);
  }
  EXPECT_FALSE(AllKept().empty());
}

TEST_F(Repair, FlippedBitsAndTruncationsComeBack) {
  const DbHash whole = HashDb(db_);
  for (int i = 0; i < 25; ++i) {
    SCOPED_TRACE(i);
    std::string bytes = bytes_;
    if (i % 5 == 4) {
      bytes.resize(bytes.size() / 4 + random_() % (bytes.size() / 2));
    } else {
      for (int flip = 0; flip < 20; ++flip)
        bytes[4096 + random_() % (bytes.size() - 4096)] ^= static_cast<char>(1 << random_() % 8);
    }
    Write(bytes);
    RepairDb(copy_, {db_});
    EXPECT_EQ(CheckDb(copy_), std::vector<std::string>());
    EXPECT_EQ(HashDb(copy_).stream, whole.stream);
    EXPECT_EQ(HashDb(copy_).map, whole.map);
  }
}

// Nothing else has the record: it is left out, named and remembered as a gap, and comes back when a file has it.
TEST_F(Repair, WhatNobodyHasIsNamedAndMayComeBackLater) {
  { SQLite::Database(db_, SQLite::OPEN_READWRITE).exec("UPDATE record SET payload = x'00' WHERE seq = 8"); }
  const std::vector<std::string> problems = CheckDb(db_);
  ASSERT_EQ(problems.size(), 1u);
  EXPECT_NE(problems[0].find("record 8 ("), std::string::npos) << problems[0];
  ::testing::internal::CaptureStdout();
  EXPECT_FALSE(RepairDb(db_, {Record({8})}));
  EXPECT_NE(::testing::internal::GetCapturedStdout().find("record 8 is not to be had"), std::string::npos);
  std::vector<std::string> rest = CheckDb(db_);
  SQLite::Database database(db_, SQLite::OPEN_READONLY);
  EXPECT_EQ(database.execAndGet("SELECT first_seq || ' ' || last_seq || ' ' || reason FROM gap").getString(),
            "8 8 damaged");
  RepairDb(db_, {Record()});
  EXPECT_EQ(CheckDb(db_), std::vector<std::string>());
  std::ofstream(copy_, std::ios::binary) << bytes_;
  EXPECT_EQ(HashDb(db_).stream, HashDb(copy_).stream);
}

TEST_F(Repair, WhatIsNoSourceIsRefusedAndNothingChanges) {
  { SQLite::Database(db_, SQLite::OPEN_READWRITE).exec("UPDATE record SET payload = x'00' WHERE seq = 8"); }
  const std::optional<std::string> before = Content(db_);
  std::ofstream(folder_.File("notes.txt")) << "windy";
  EXPECT_THROW(RepairDb(db_, {folder_.File("notes.txt")}), std::runtime_error);
  EXPECT_EQ(Content(db_), before);
  EXPECT_FALSE(std::filesystem::exists(db_ + ".part"));
}

}  // namespace damage_test
}  // namespace mapmend
