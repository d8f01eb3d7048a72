#include "libs/bus/recording_file.h"

#include <gtest/gtest.h>

#include <memory>
#include <stdexcept>

#include "libs/base/write_file.h"
#include "tests/scratch_folder.h"

namespace mapmend {
namespace recording_file_test {

void AppendNumber(std::string* bytes, int64_t number, int size) {
  for (int i = size - 1; i >= 0; --i) *bytes += static_cast<char>(number >> (8 * i));
}

// An event as lcm-logger writes it.
std::string Event(int64_t utime, const std::string& channel, const std::string& data) {
  std::string bytes = "\xED\xA1\xDA\x01";
  AppendNumber(&bytes, 0, 8);
  AppendNumber(&bytes, utime, 8);
  AppendNumber(&bytes, static_cast<int64_t>(channel.size()), 4);
  AppendNumber(&bytes, static_cast<int64_t>(data.size()), 4);
  return bytes + channel + data;
}

class RecordingFileTest : public ::testing::Test {
 protected:
  // Channel and data of all that is read.
  std::vector<std::string> Read(const std::string& bytes) {
    WriteFile(path_, bytes);
    file_ = std::make_unique<RecordingFile>(path_);
    std::vector<std::string> read;
    LoggedEvent event;
    while (file_->Next(&event)) read.push_back(event.channel + ":" + std::string(event.data.begin(), event.data.end()));
    return read;
  }

  ScratchFolder folder_;
  std::string path_ = folder_.File("log");
  std::unique_ptr<RecordingFile> file_;
  const std::string a_ = Event(10, "A", "one"), b_ = Event(20, "B", "second"), c_ = Event(30, "C", "");
  const std::vector<std::string> all_ = {"A:one", "B:second", "C:"};
};

TEST_F(RecordingFileTest, GivesAllEventsInOrderAndAnyAgain) {
  EXPECT_EQ(Read(a_ + b_ + c_), all_);
  EXPECT_TRUE(file_->Damages().empty());
  EXPECT_FALSE(file_->HasTornEnd());
  LoggedEvent event;
  ASSERT_TRUE(file_->ReadAt(static_cast<int64_t>(a_.size()), &event));
  EXPECT_EQ(event.channel, "B");
  EXPECT_EQ(event.utime, 20);
  EXPECT_FALSE(file_->ReadAt(static_cast<int64_t>(a_.size() + b_.size() + c_.size()), &event));
}

TEST_F(RecordingFileTest, GoesOnBehindWhatIsNoEvent) {
  EXPECT_EQ(Read(a_ + "noise" + b_ + c_), all_);
  // The event before it counts as well: nothing begins where its length says that it ends.
  ASSERT_EQ(file_->Damages().size(), 1u);
  EXPECT_EQ(file_->Damages()[0].offset, 0);
  EXPECT_EQ(file_->Damages()[0].num_bytes, static_cast<int64_t>(a_.size()) + 5);
}

TEST_F(RecordingFileTest, AnEventWithoutItsSyncWordIsAnEventStill) {
  std::string damaged = b_;
  damaged[0] = 'x';
  EXPECT_EQ(Read(a_ + damaged + c_), all_);
  ASSERT_EQ(file_->Damages().size(), 1u);
  EXPECT_EQ(file_->Damages()[0].num_bytes, 4);
}

TEST_F(RecordingFileTest, AWrongLengthCostsOneEvent) {
  std::string damaged = b_;
  damaged[27] = static_cast<char>(damaged[27] + 2);  // of the data
  const std::vector<std::string> read = Read(a_ + damaged + c_);
  ASSERT_FALSE(read.empty());
  EXPECT_EQ(read.front(), "A:one");
  EXPECT_EQ(read.back(), "C:");
  EXPECT_EQ(file_->Damages().size(), 1u);
}

TEST_F(RecordingFileTest, ATornEndIsNoDamage) {
  for (const size_t left : {size_t{2}, size_t{20}, c_.size() - 1}) {
    SCOPED_TRACE(left);
    EXPECT_EQ(Read(a_ + b_ + c_.substr(0, left)), (std::vector<std::string>{"A:one", "B:second"}));
    EXPECT_TRUE(file_->HasTornEnd());
    EXPECT_TRUE(file_->Damages().empty());
  }
}

TEST_F(RecordingFileTest, WhatIsNoRecordingIsRefused) {
  EXPECT_THROW(RecordingFile(folder_.File("gone")), std::runtime_error);
  EXPECT_THROW(RecordingFile(folder_.Path()), std::runtime_error);
  WriteFile(path_, "not a log at all");
  EXPECT_THROW(RecordingFile{path_}, std::runtime_error);
  EXPECT_FALSE(RecordingFile::IsLog(path_));
}

TEST_F(RecordingFileTest, PartsOfAFolderComeByTheirTimes) {
  EXPECT_THROW(FindLogs({folder_.Path()}), std::runtime_error);
  WriteFile(folder_.File("a"), b_);
  WriteFile(folder_.File("b"), a_ + c_);
  WriteFile(folder_.File("notes"), "of the day");
  EXPECT_EQ(FindLogs({folder_.Path(), "x"}), (std::vector<std::string>{folder_.File("b"), folder_.File("a"), "x"}));
}

}  // namespace recording_file_test
}  // namespace mapmend
