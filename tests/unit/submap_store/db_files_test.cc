// The file itself: migrations, what a stranger reads from it, and the tools of `mapmend db`.

#include <gtest/gtest.h>

#include <algorithm>
#include <cstdio>
#include <filesystem>
#include <fstream>
#include <sstream>

#include "libs/wire/codec.h"
#include "libs/wire/revision_codec.h"
#include "procs/submap_store/blob.h"
#include "procs/submap_store/db_commands.h"
#include "procs/submap_store/schema.h"
#include "procs/submap_store/sha256.h"
#include "procs/submap_store/submap_store.h"
#include "tests/scratch_folder.h"
#include "tests/synthetic_stream.h"

namespace mapmend {
namespace db_files_test {

SyntheticStreamOptions Flight(const std::string& session) {
  SyntheticStreamOptions options;
  options.session = session;
  options.seed = static_cast<unsigned>(session.size());
  return options;
}

void Fill(const std::string& path, const SyntheticStreamOptions& flight) {
  SubmapStoreOptions options;
  options.path = path;
  SubmapStore store(options);
  for (const Record& record : MakeSyntheticStream(flight)) {
    const EncodedRecord encoded = EncodeRecord(record);
    store.OnRecord(encoded.channel, encoded.data.data(), static_cast<int>(encoded.data.size()), 0);
  }
  store.CommitReady(0);
  while (store.WorkInBackground()) continue;
}

RevisionHead MakeRevision(int64_t number, double scale, int num_parts) {
  RevisionHead head;
  head.transforms.revision = number;
  head.transforms.submaps = {{{"a", SubmapId(0)}, 0, {}, false}};
  head.transforms.submaps[0].root_from_submap.scale = scale;
  EvaluatedConnection connection;
  connection.a = {"a", SubmapId(0)};
  connection.b = {"a", SubmapId(1)};
  connection.verdict = EvaluatedConnection::Verdict::kAccepted;
  connection.strength = 12.5;
  head.connections = {connection};
  head.num_parts = num_parts;
  return head;
}

class DbFiles : public ::testing::Test {
 protected:
  int64_t Count(const std::string& path, const std::string& sql) {
    SQLite::Database database(path, SQLite::OPEN_READONLY);
    return database.execAndGet(sql).getInt64();
  }
  ScratchFolder folder_;
  std::string db_ = folder_.File("map.db");
};

TEST_F(DbFiles, OlderSchemasAreBroughtUpToDateWithoutLoss) {
  Fill(db_, Flight("a"));
  const DbHash hash = HashDb(db_);
  for (int version = 1; version < kSchemaVersion; ++version) {
    // A file as a program of that version left it: its tables, filled from the new one.
    const std::string old = folder_.File("v" + std::to_string(version) + ".db");
    {
      SQLite::Database database(old, SQLite::OPEN_READWRITE | SQLite::OPEN_CREATE);
      database.exec("PRAGMA application_id = " + std::to_string(kApplicationId));
      Migrate(&database, version);
      database.exec("ATTACH DATABASE '" + db_ + "' AS new");
      for (const char* table : {"session", "record", "gap"}) {
        std::string columns;
        SQLite::Statement info(database, std::string("SELECT name FROM pragma_table_info('") + table + "')");
        while (info.executeStep()) columns += (columns.empty() ? "" : ", ") + info.getColumn(0).getString();
        database.exec(std::string("INSERT INTO main.") + table + "(" + columns + ") SELECT " + columns + " FROM new." +
                      table);
      }
      if (version >= 2) database.exec("UPDATE session SET is_derived = 0");
    }
    EXPECT_THROW(HashDb(old), std::runtime_error);  // reading does not migrate
    CompactDb(old);
    EXPECT_EQ(HashDb(old).stream, hash.stream);
    EXPECT_TRUE(CheckDb(old).empty());
    for (const char* table : {"submap", "keyframe", "keyframe_bow", "keyframe_geometry", "map_points"}) {
      const std::string sql = std::string("SELECT count(*) FROM ") + table;
      EXPECT_EQ(Count(old, sql), Count(db_, sql)) << table;
      EXPECT_GT(Count(old, sql), 0) << table;
    }
  }
}

// As a program of schema 3 left it: whole, with an array of map points per keyframe.
TEST_F(DbFiles, ObservationsOfSchema3ArePacked) {
  Fill(db_, Flight("a"));
  const std::string old = folder_.File("v3.db");
  {
    SQLite::Database database(old, SQLite::OPEN_READWRITE | SQLite::OPEN_CREATE);
    database.exec("PRAGMA application_id = " + std::to_string(kApplicationId));
    Migrate(&database, 3);
    database.exec("ATTACH DATABASE '" + db_ + "' AS new");
    for (const char* table : {"session", "submap", "keyframe", "keyframe_bow", "map_points"}) {
      database.exec(std::string("INSERT INTO main.") + table + " SELECT * FROM new." + table);
    }
    database.exec("INSERT INTO main.record SELECT session, seq, channel, utime, payload FROM new.record");
    database.exec(
        "INSERT INTO main.keyframe_geometry SELECT session, keyframe, cam_from_submap, zeroblob(400), covisible "
        "FROM new.keyframe_geometry");
  }
  CompactDb(old);
  EXPECT_TRUE(CheckDb(old).empty());
  EXPECT_EQ(HashDb(old).stream, HashDb(db_).stream);
  const auto geometry = [](const std::string& path) {
    std::vector<std::vector<uint8_t>> blobs;
    SQLite::Database database(path, SQLite::OPEN_READONLY);
    SQLite::Statement rows(database,
                           "SELECT cam_from_submap, observations, covisible FROM keyframe_geometry ORDER BY 1");
    while (rows.executeStep()) {
      for (int i = 0; i < 3; ++i) blobs.push_back(ReadBlob<uint8_t>(rows.getColumn(i)));
    }
    return blobs;
  };
  EXPECT_FALSE(geometry(db_).empty());
  EXPECT_EQ(geometry(old), geometry(db_));
  EXPECT_EQ(Count(old, "SELECT count(*) FROM submap WHERE has_geometry"), 2);
}

// The store was killed while it created the file: SQLite takes back what is there, down to the mark of whose file it
// is.
TEST_F(DbFiles, AFileWhoseCreationWasCutShortIsMarkedAnew) {
  {
    SQLite::Database database(db_, SQLite::OPEN_READWRITE | SQLite::OPEN_CREATE);
    database.exec("PRAGMA application_id = " + std::to_string(kApplicationId));
  }
  // Header of a rollback journal: no page to restore, the database had none
  // (https://www.sqlite.org/fileformat.html, section 3).
  std::vector<uint8_t> journal(512, 0);
  const uint8_t header[] = {0xd9, 0xd5, 0x05, 0xf9, 0x20, 0xa1, 0x63, 0xd7, 0, 0, 0, 0, 0,    0,
                            0,    1,    0,    0,    0,    0,    0,    0,    2, 0, 0, 0, 0x10, 0};
  std::copy(std::begin(header), std::end(header), journal.begin());
  std::ofstream(db_ + "-journal", std::ios::binary).write(reinterpret_cast<const char*>(journal.data()), 512);
  Fill(db_, Flight("a"));
  EXPECT_EQ(Count(db_, "PRAGMA application_id"), kApplicationId);
  EXPECT_TRUE(CheckDb(db_).empty());
  EXPECT_GT(Count(db_, "SELECT count(*) FROM record"), 0);
}

// An SQLite file in use by another program bears its tables in the write-ahead log only.
TEST_F(DbFiles, AFileOfAnotherProgramInWalModeIsRefused) {
  SQLite::Database other(db_, SQLite::OPEN_READWRITE | SQLite::OPEN_CREATE);
  other.exec("PRAGMA journal_mode = WAL");
  other.exec("CREATE TABLE theirs(a)");
  EXPECT_THROW(Database(db_, Database::Mode::kReadWrite), std::runtime_error);
  EXPECT_EQ(other.execAndGet("SELECT count(*) FROM sqlite_master").getInt(), 1);
  EXPECT_EQ(other.execAndGet("PRAGMA user_version").getInt(), 0);
}

// Read as docs/file_formats.md says.
TEST_F(DbFiles, ObservationsSayWhatEachFeatureObserves) {
  Fill(db_, Flight("a"));
  Session model;
  for (const Record& record : MakeSyntheticStream(Flight("a"))) ASSERT_EQ(model.Apply(record), "");
  SQLite::Database database(db_, SQLite::OPEN_READONLY);
  for (const auto& [submap_id, submap] : model.submaps) {
    for (const auto& [id, keyframe] : submap.keyframes) {
      SQLite::Statement row(database, "SELECT observations FROM keyframe_geometry WHERE keyframe = ?");
      row.bind(1, id.value);
      ASSERT_TRUE(row.executeStep());
      std::vector<int64_t> numbers(1, 0);
      int shift = 0;
      for (const uint8_t byte : ReadBlob<uint8_t>(row.getColumn(0))) {
        numbers.back() |= static_cast<int64_t>(byte & 127) << shift;
        shift = byte & 128 ? shift + 7 : 0;
        if (shift == 0) numbers.push_back(0);
      }
      std::vector<MapPointId> points(keyframe.map_points.size());
      int64_t feature = -1, point = 0;
      for (size_t i = 0; i + 1 < numbers.size(); i += 2) {
        feature += numbers[i] + 1;
        point += numbers[i + 1] & 1 ? -(numbers[i + 1] + 1) / 2 : numbers[i + 1] / 2;
        points.at(static_cast<size_t>(feature)) = MapPointId(static_cast<int32_t>(point));
      }
      EXPECT_EQ(points, keyframe.map_points);
    }
  }
}

TEST_F(DbFiles, AStrangerReadsItWithThePythonOfTheDocumentation) {
  Fill(db_, Flight("a"));
  std::ifstream doc(std::string(MAPMEND_SOURCE_DIR) + "/docs/file_formats.md");
  std::string line;
  std::ofstream script(folder_.File("read.py"));
  bool inside = false;
  int num_lines = 0;
  while (std::getline(doc, line)) {
    if (inside && line == "```") break;
    if (inside) script << line << "\n";
    if (inside && !line.empty()) ++num_lines;
    inside = inside || line == "```python";
  }
  script.close();
  EXPECT_LE(num_lines, 20);
  const std::string out = folder_.File("out.txt");
  ASSERT_EQ(std::system(("python3 " + folder_.File("read.py") + " " + db_ + " > " + out).c_str()), 0);

  std::map<std::pair<std::string, int>, std::array<double, 3>> read;
  std::ifstream in(out);
  std::string kind, uuid;
  int submap = 0, id = 0;
  double x = 0, y = 0, z = 0;
  while (in >> kind >> uuid >> submap >> id >> x >> y >> z) read[{kind, id}] = {x, y, z};
  Session model;
  for (const Record& record : MakeSyntheticStream(Flight("a"))) ASSERT_EQ(model.Apply(record), "");
  size_t num_expected = 0;
  for (const auto& [submap_id, content] : model.submaps) {
    num_expected += content.keyframes.size() + content.points.size();
    for (const auto& [keyframe_id, keyframe] : content.keyframes) {
      ASSERT_TRUE(read.contains({"keyframe", keyframe_id.value}));
      const Eigen::Vector3d center = keyframe.cam_from_submap.Center();
      for (int i = 0; i < 3; ++i)
        EXPECT_NEAR((read[{"keyframe", keyframe_id.value}][static_cast<size_t>(i)]), center[i], 1e-9);
    }
    for (const auto& [point_id, point] : content.points) {
      ASSERT_TRUE(read.contains({"point", point_id.value}));
      EXPECT_NEAR((read[{"point", point_id.value}][2]), point.position.z(), 1e-5);
    }
  }
  EXPECT_EQ(read.size(), num_expected);
}

// It was killed before it was done, or when it was.
TEST_F(DbFiles, ACopyTakesThePlaceOfWhatOneThatWasKilledHasLeft) {
  const std::string other = folder_.File("other.db"), copy = folder_.File("copy.db");
  Fill(db_, Flight("a"));
  {
    Database killed(other, Database::Mode::kReadWrite);
    killed.Sql().exec("CREATE TABLE left_by_a_copy (x)");
    for (const std::string& place : {copy, copy + ".part"}) {
      for (const char* suffix : {"", "-wal"}) std::filesystem::copy_file(other + suffix, place + suffix);
    }
  }
  EXPECT_TRUE(CopyFlights(db_, copy).empty());
  EXPECT_TRUE(CheckDb(copy).empty());
  EXPECT_EQ(Count(copy, "SELECT count(*) FROM record"), Count(db_, "SELECT count(*) FROM record"));
  EXPECT_EQ(Count(copy, "SELECT count(*) FROM sqlite_master WHERE name = 'left_by_a_copy'"), 0);
  EXPECT_FALSE(std::filesystem::exists(copy + ".part"));
}

TEST_F(DbFiles, MergePutsFlightsTogetherSoThatTheyCanBeSearchedTogether) {
  const std::string b = folder_.File("b.db"), merged = folder_.File("merged.db");
  SyntheticStreamOptions later = Flight("later");
  later.start_utime += 3600000000;
  later.num_submaps = 1;  // so that there is nothing else to find
  Fill(db_, later);
  Fill(b, Flight("a"));
  MergeDbs({db_, b}, merged);
  EXPECT_TRUE(CheckDb(merged).empty());
  EXPECT_EQ(Count(merged, "SELECT count(*) FROM record"),
            Count(db_, "SELECT count(*) FROM record") + Count(b, "SELECT count(*) FROM record"));
  SubmapStoreOptions options;
  options.path = merged;
  SubmapStore store(options);
  const FetchAnswer list = store.Fetch(FetchRequest{});
  ASSERT_EQ(list.sessions.size(), 2u);
  EXPECT_EQ(list.sessions[0].session, "a");  // the older flight first
  BowQuery query;
  query.session = "later";
  query.keyframe = KeyframeId(4);
  query.cursors = list.sessions;
  const BowAnswer answer = store.Query(query);
  ASSERT_EQ(answer.status, BowAnswer::Status::kOk);
  ASSERT_GE(answer.proposals.size(), 1u);
  EXPECT_EQ(answer.proposals[0].session, "a");
  EXPECT_EQ(answer.proposals[0].keyframe.value % 10, 4);  // the same place
}

TEST_F(DbFiles, MergeRefusesWhatDoesNotBelongTogether) {
  const std::string b = folder_.File("b.db"), merged = folder_.File("merged.db");
  SyntheticStreamOptions other = Flight("b");
  other.vocabulary_hash = "other";
  Fill(db_, Flight("a"));
  Fill(b, other);
  EXPECT_THROW(MergeDbs({db_, b}, merged), std::runtime_error);
  EXPECT_FALSE(std::filesystem::exists(merged));
  EXPECT_THROW(MergeDbs({db_, db_}, merged), std::runtime_error);
  EXPECT_THROW(MergeDbs({db_, folder_.File("missing.db")}, merged), std::runtime_error);
  EXPECT_THROW(MergeDbs({db_, b}, db_), std::runtime_error);
}

TEST_F(DbFiles, CheckFindsWhatDoesNotFit) {
  Fill(db_, Flight("a"));
  { SQLite::Database(db_, SQLite::OPEN_READWRITE).exec("DELETE FROM record WHERE seq = 8"); }
  const auto problems = CheckDb(db_);
  ASSERT_FALSE(problems.empty());
  EXPECT_NE(problems[0].find("record 8"), std::string::npos);
}

TEST_F(DbFiles, HashIsOfContentNotOfPages) {
  Fill(db_, Flight("a"));
  const std::string before = HashDb(db_).stream;
  CompactDb(db_);
  EXPECT_EQ(HashDb(db_).stream, before);
  { SQLite::Database(db_, SQLite::OPEN_READWRITE).exec("UPDATE record SET payload = x'00' WHERE seq = 8"); }
  EXPECT_THROW(HashDb(db_), std::runtime_error);  // a digest of damage says nothing
}

TEST_F(DbFiles, RevisionsAreStoredReplacedAndFoundAgain) {
  Database database(db_, Database::Mode::kReadWrite);
  RevisionStore revisions(&database);
  const auto store = [&](const RevisionHead& revision) {
    const auto data = Encode(revision);
    return revisions.Store(data.data(), static_cast<int>(data.size()));
  };
  const auto store_part = [&](int64_t number, int32_t part) {
    const auto data = Encode(RevisionPart{number, part, {{"a", SubmapId(part)}, {}, {}, {}}});
    return revisions.StorePart(data.data(), static_cast<int>(data.size()));
  };
  EXPECT_EQ(revisions.NewestComplete(), -1);
  ASSERT_TRUE(store(MakeRevision(1, 1.0, 0)));
  ASSERT_TRUE(store(MakeRevision(2, 1.5, 2)));
  store_part(2, 0);
  EXPECT_EQ(revisions.NewestComplete(), 1);
  store_part(2, 1);
  EXPECT_EQ(revisions.NewestComplete(), 2);
  const std::string map = HashDb(db_).map;
  EXPECT_FALSE(map.empty());
  EXPECT_TRUE(store(MakeRevision(2, 1.5, 2)));  // the same again changes nothing
  EXPECT_EQ(revisions.NewestComplete(), 2);
  ASSERT_TRUE(store(MakeRevision(7, 1.5, 2)));
  store_part(7, 1);
  store_part(7, 0);
  EXPECT_EQ(HashDb(db_).map, map);  // another number, the same map
  ASSERT_TRUE(store(MakeRevision(7, 2.0, 0)));
  EXPECT_EQ(revisions.NewestComplete(), 7);
  EXPECT_NE(HashDb(db_).map, map);
  RevisionHead invalid = MakeRevision(8, std::nan(""), 0);
  EXPECT_FALSE(store(invalid));
  invalid = MakeRevision(8, 1, 0);
  invalid.transforms.edges = {{5, 5}};
  EXPECT_FALSE(store(invalid));
}

TEST(Sha256, AgreesWithTheStandardsExamples) {
  const auto digest = [](const std::string& text) {
    Sha256 hash;
    hash.Add(text.data(), text.size());
    return hash.Hex();
  };
  EXPECT_EQ(digest(""), "e3b0c44298fc1c149afbf4c8996fb92427ae41e4649b934ca495991b7852b855");
  EXPECT_EQ(digest("abc"), "ba7816bf8f01cfea414140de5dae2223b00361a396177a9cb410ff61f20015ad");
  EXPECT_EQ(digest("abcdbcdecdefdefgefghfghighijhijkijkljklmklmnlmnomnopnopq"),
            "248d6a61d20638b8e5c026930c3e6039a33ce45964ff2167f6ecedd419db06c1");
  EXPECT_EQ(digest(std::string(1000000, 'a')), "cdc76e5c9914fb9281a1c7e284d73e67f1809a48a497200e046d39ccc7112cd0");
}

}  // namespace db_files_test
}  // namespace mapmend
