// What the store does with files that it cannot or must not use, and when the disk is full.

#include <gtest/gtest.h>
#include <sched.h>
#include <sys/mount.h>
#include <sys/stat.h>
#include <unistd.h>

#include <filesystem>
#include <fstream>

#include "procs/submap_store/database.h"
#include "procs/submap_store/db_commands.h"
#include "procs/submap_store/schema.h"
#include "tests/process/store_helper.h"
#include "tests/scratch_folder.h"

namespace mapmend {
namespace store_files_test {

class StoreFiles : public ::testing::Test {
 protected:
  // The store must refuse db_ with one line that holds `what`, and leave the file alone.
  void ExpectRefused(const std::string& what) {
    const std::string before = ReadWholeFile(db_);
    const TestOutput result =
        RunProgram({ProgramPath("submap_store"), "--db", db_, "--lcm-url", "memq://"}, folder_.File("log.txt"));
    EXPECT_EQ(result.exit_code, 1);
    EXPECT_NE(result.output.find(what), std::string::npos) << result.output;
    EXPECT_NE(result.output.find(db_), std::string::npos) << result.output;
    EXPECT_EQ(std::count(result.output.begin(), result.output.end(), '\n'), 1) << result.output;
    EXPECT_EQ(ReadWholeFile(db_), before);
  }
  void MakeDatabase() { ExpectedStreamHash(SyntheticStreamOptions(), db_); }

  ScratchFolder folder_;
  std::string db_ = folder_.File("map.db");
};

TEST_F(StoreFiles, RefusesATruncatedFile) {
  MakeDatabase();
  std::filesystem::resize_file(db_, std::filesystem::file_size(db_) / 2);
  ExpectRefused("truncated");
}

TEST_F(StoreFiles, RefusesAFileWithDamagedPages) {
  MakeDatabase();
  {
    std::fstream file(db_, std::ios::in | std::ios::out | std::ios::binary);
    file.seekp(4096);
    file << std::string(20 * 4096, '\xee');
  }
  ExpectRefused("malformed");
  const TestOutput check = RunProgram({ProgramPath("mapmend"), "db", "check", db_}, folder_.File("log.txt"));
  EXPECT_EQ(check.exit_code, 1);
  EXPECT_NE(check.output.find(db_), std::string::npos) << check.output;
}

TEST_F(StoreFiles, RefusesAForeignFile) {
  std::ofstream(db_) << "# not a database, but a text that somebody still needs\n";
  ExpectRefused("not a map database");
}

TEST_F(StoreFiles, RefusesAnSqliteFileOfAnotherProgram) {
  { SQLite::Database(db_, SQLite::OPEN_READWRITE | SQLite::OPEN_CREATE).exec("CREATE TABLE recipes(title TEXT)"); }
  ExpectRefused("another program");
}

TEST_F(StoreFiles, RefusesANewerSchema) {
  MakeDatabase();
  {
    SQLite::Database newer(db_, SQLite::OPEN_READWRITE);
    newer.exec("PRAGMA user_version = " + std::to_string(kSchemaVersion + 1));
    newer.exec("PRAGMA journal_mode = DELETE");
  }
  ExpectRefused("schema version " + std::to_string(kSchemaVersion + 1));
}

TEST_F(StoreFiles, RefusesAFolderAndAnUnwritablePlace) {
  db_ = folder_.Path();
  const TestOutput folder = RunProgram({ProgramPath("submap_store"), "--db", db_}, folder_.File("log.txt"));
  EXPECT_EQ(folder.exit_code, 1);
  const TestOutput nowhere =
      RunProgram({ProgramPath("submap_store"), "--db", folder_.File("no/such/folder.db")}, folder_.File("log.txt"));
  EXPECT_EQ(nowhere.exit_code, 1);
  EXPECT_NE(nowhere.output.find("no/such/folder.db"), std::string::npos);
}

TEST_F(StoreFiles, RefusesToShareAFileWithAnotherStore) {
  const int port = AnyFreePort();
  TestProcess hub = StartHub(port, folder_.File("hub.txt"));
  TestProcess first = StartStore(db_, port, folder_.File("first.txt"));
  ASSERT_TRUE(PollUntil([&] { return ReadWholeFile(folder_.File("first.txt")).find("keyframes") != std::string::npos; },
                        10000));
  const TestOutput second =
      RunProgram({ProgramPath("submap_store"), "--db", db_, "--lcm-url", HubUrl(port)}, folder_.File("log.txt"));
  EXPECT_EQ(second.exit_code, 1);
  EXPECT_NE(second.output.find("in use"), std::string::npos) << second.output;
  EXPECT_TRUE(first.IsRunning());
  EXPECT_EQ(first.Terminate(), 0);
}

void WriteText(const std::string& path, const std::string& text) { std::ofstream(path) << text; }

// A small file system that only this process and its children see: as root, or as anybody where user namespaces are
// allowed.
bool MountSmallDisk(const std::string& path, int megabytes) {
  if (unshare(CLONE_NEWNS) != 0) {
    const std::string uid = std::to_string(getuid()), gid = std::to_string(getgid());
    if (unshare(CLONE_NEWUSER | CLONE_NEWNS) != 0) return false;
    WriteText("/proc/self/setgroups", "deny");
    WriteText("/proc/self/uid_map", uid + " " + uid + " 1");
    WriteText("/proc/self/gid_map", gid + " " + gid + " 1");
  }
  mount(nullptr, "/", nullptr, MS_REC | MS_PRIVATE, nullptr);
  return mount("tmpfs", path.c_str(), "tmpfs", 0, ("size=" + std::to_string(megabytes) + "m").c_str()) == 0;
}

TEST_F(StoreFiles, StopsAcknowledgingOnAFullDiskAndGoesOnWhenThereIsRoom) {
  const std::string disk = folder_.File("disk");
  mkdir(disk.c_str(), 0755);
  if (!MountSmallDisk(disk, 8)) GTEST_SKIP() << "a full disk needs root, or user namespaces, to mount a small tmpfs";
  db_ = disk + "/map.db";
  { std::ofstream(disk + "/ballast") << std::string(4 << 20, 'x'); }
  SyntheticStreamOptions flight;
  flight.num_submaps = 2;
  flight.keyframes_per_submap = 60;
  flight.num_features = 600;
  const int port = AnyFreePort();
  TestProcess hub = StartHub(port, folder_.File("hub.txt"));
  TestProcess store = StartStore(db_, port, folder_.File("store.txt"));
  SharedProgress* progress = MapSharedProgress();
  TestProcess frontend([&] { RunFrontend(flight, port, folder_.File("outbox"), 0, progress); });
  ASSERT_TRUE(PollUntil([&] { return progress->store_reports_error; }, 30000));
  PauseMs(500);
  const int64_t acknowledged = progress->acknowledged;
  EXPECT_GT(acknowledged, 10);
  EXPECT_LT(acknowledged, 300);
  PauseMs(500);
  EXPECT_EQ(progress->acknowledged, acknowledged);
  EXPECT_TRUE(store.IsRunning());
  EXPECT_NE(ReadWholeFile(folder_.File("store.txt")).find("disk full"), std::string::npos);

  mount(nullptr, disk.c_str(), nullptr, MS_REMOUNT, "size=64m");
  unlink((disk + "/ballast").c_str());
  EXPECT_EQ(frontend.Wait(60000), 0);
  EXPECT_EQ(store.Terminate(), 0);
  EXPECT_TRUE(CheckDb(db_).empty());
  EXPECT_EQ(HashDb(db_).stream, ExpectedStreamHash(flight, folder_.File("expected.db")));
  umount2(disk.c_str(), MNT_DETACH);
}

}  // namespace store_files_test
}  // namespace mapmend
