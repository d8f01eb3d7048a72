// A map database on a disk that forgets: whatever changes what the file says is seen by `db check`.

#include <gtest/gtest.h>

#include <fstream>
#include <functional>
#include <optional>
#include <random>

#include "libs/bus/bus.h"
#include "libs/bus/checksum.h"
#include "procs/submap_store/db_commands.h"
#include "tests/scratch_folder.h"
#include "tests/unit/submap_store/filled_db.h"

namespace mapmend {
namespace {

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

}  // namespace
}  // namespace mapmend
