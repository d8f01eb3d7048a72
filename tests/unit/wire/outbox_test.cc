#include "libs/wire/outbox.h"

#include <gtest/gtest.h>
#include <sys/resource.h>

#include <csignal>
#include <filesystem>
#include <fstream>

#include "tests/scratch_folder.h"

namespace mapmend {
namespace outbox_test {

EncodedRecord MakeRecord(int64_t seq, size_t size = 1000) {
  EncodedRecord record{"s1", seq, "MAPMEND_KEYFRAME", std::vector<uint8_t>(size)};
  for (size_t i = 0; i < size; ++i) record.data[i] = static_cast<uint8_t>(i * 7 + static_cast<size_t>(seq));
  return record;
}

class OutboxTest : public ::testing::Test {
 protected:
  ScratchFolder folder_;
  std::string path_ = folder_.File("outbox");
};

TEST_F(OutboxTest, HoldsWhatIsNotAcknowledgedAcrossProcesses) {
  {
    Outbox outbox(path_);
    for (int64_t seq = 0; seq < 10; ++seq) outbox.Append(MakeRecord(seq));
    outbox.Acknowledge(3);
  }
  Outbox outbox(path_);
  // Acknowledgements are not written down: what was committed is sent again, which does no harm.
  EXPECT_EQ(outbox.FirstSeq(), 0);
  EXPECT_EQ(outbox.LastSeq(), 9);
  EXPECT_EQ(outbox.Session(), "s1");
  const auto record = outbox.Read(7);
  ASSERT_TRUE(record);
  EXPECT_EQ(record->data, MakeRecord(7).data);
  EXPECT_EQ(record->channel, "MAPMEND_KEYFRAME");
  EXPECT_FALSE(outbox.Read(10));
}

TEST_F(OutboxTest, RemembersOnlyTheLastNumberOnceAllIsAcknowledged) {
  {
    Outbox outbox(path_);
    for (int64_t seq = 0; seq < 5; ++seq) outbox.Append(MakeRecord(seq));
    outbox.Acknowledge(4);
    EXPECT_TRUE(outbox.Empty());
    EXPECT_LT(std::filesystem::file_size(path_), 200u);
  }
  {
    Outbox outbox(path_);
    EXPECT_TRUE(outbox.Empty());
    EXPECT_EQ(outbox.Session(), "s1");
    EXPECT_EQ(outbox.LastSeq(), 4);
    outbox.Append(MakeRecord(5));
    outbox.Append(MakeRecord(6));
  }
  Outbox outbox(path_);
  EXPECT_EQ(outbox.FirstSeq(), 5);
  EXPECT_EQ(outbox.Read(6)->data, MakeRecord(6).data);
  EXPECT_FALSE(outbox.Read(4));
}

TEST_F(OutboxTest, StartsAfreshForAnotherSessionOnceAllIsAcknowledged) {
  Outbox outbox(path_);
  outbox.Append(MakeRecord(0));
  outbox.Acknowledge(0);
  EncodedRecord other = MakeRecord(0);
  other.session = "s2";
  outbox.Append(other);
  EXPECT_EQ(outbox.Session(), "s2");
  EXPECT_EQ(outbox.Read(0)->session, "s2");
}

TEST_F(OutboxTest, CutsOffATornEnd) {
  {
    Outbox outbox(path_);
    for (int64_t seq = 0; seq < 5; ++seq) outbox.Append(MakeRecord(seq));
  }
  std::filesystem::resize_file(path_, std::filesystem::file_size(path_) - 10);
  Outbox outbox(path_);
  EXPECT_EQ(outbox.LastSeq(), 3);
  outbox.Append(MakeRecord(4));
  EXPECT_EQ(outbox.Read(4)->data, MakeRecord(4).data);
}

TEST_F(OutboxTest, LeavesAForeignFileAsItIs) {
  std::ofstream(path_) << "my diary, long enough";
  EXPECT_THROW(Outbox{path_}, std::runtime_error);
  std::ifstream in(path_);
  std::string text;
  std::getline(in, text);
  EXPECT_EQ(text, "my diary, long enough");
}

TEST_F(OutboxTest, BelongsToOneProcessAtATime) {
  Outbox outbox(path_);
  EXPECT_THROW(Outbox{path_}, std::runtime_error);
}

TEST_F(OutboxTest, GivesBackDiskWhileMuchIsStillHeld) {
  Outbox outbox(path_);
  for (int64_t seq = 0; seq < 100; ++seq) outbox.Append(MakeRecord(seq, 1 << 20));
  outbox.Acknowledge(80);
  EXPECT_LT(std::filesystem::file_size(path_), 40u << 20);
  for (int64_t seq = 81; seq < 100; ++seq) EXPECT_EQ(outbox.Read(seq)->data, MakeRecord(seq, 1 << 20).data);
  outbox.Append(MakeRecord(100));
  EXPECT_EQ(outbox.Read(100)->data, MakeRecord(100).data);
}

TEST_F(OutboxTest, NumbersMayHaveHoles) {
  {
    Outbox outbox(path_);
    for (const int64_t seq : {3, 9, 4000}) outbox.Append(MakeRecord(seq));
  }
  Outbox outbox(path_);
  EXPECT_EQ(outbox.Size(), 3);
  EXPECT_EQ(outbox.FirstSeq(), 3);
  EXPECT_EQ(outbox.LastSeq(), 4000);
  EXPECT_EQ(outbox.Read(9)->data, MakeRecord(9).data);
  EXPECT_EQ(outbox.Read(4000)->data, MakeRecord(4000).data);
  for (const int64_t seq : {0, 4, 10, 3999, 4001}) EXPECT_FALSE(outbox.Read(seq)) << seq;
  EXPECT_EQ(outbox.NextSeq(-1), 3);
  EXPECT_EQ(outbox.NextSeq(3), 9);
  EXPECT_EQ(outbox.NextSeq(4000), -1);
  outbox.Acknowledge(8);
  EXPECT_EQ(outbox.FirstSeq(), 9);
}

TEST_F(OutboxTest, LeavesOutWhatIsDamagedInTheMiddle) {
  int64_t begin = 0, end = 0;
  {
    Outbox outbox(path_);
    for (int64_t seq = 0; seq < 6; ++seq) {
      if (seq == 2) begin = outbox.FileBytes();
      if (seq == 4) end = outbox.FileBytes();
      outbox.Append(MakeRecord(seq));
    }
  }
  {
    std::fstream file(path_, std::ios::in | std::ios::out | std::ios::binary);
    file.seekp(begin + 100);
    for (int64_t i = begin + 100; i < end - 50; ++i) file.put(0);  // as after a power cut
  }
  Outbox outbox(path_);
  EXPECT_EQ(outbox.Size(), 4);
  EXPECT_EQ(outbox.LastSeq(), 5);
  EXPECT_FALSE(outbox.Read(2));
  EXPECT_EQ(outbox.NextSeq(1), 4);
  outbox.Append(MakeRecord(6));
  EXPECT_EQ(outbox.Read(6)->data, MakeRecord(6).data);
  EXPECT_EQ(outbox.Read(4)->data, MakeRecord(4).data);
}

TEST_F(OutboxTest, GivesUpTheOldestWhenMemoryIsFullToo) {
  Outbox outbox("", 10000);
  for (int64_t seq = 0; seq < 25; ++seq) outbox.Append(MakeRecord(seq));
  EXPECT_EQ(outbox.FirstSeq(), 15);
  EXPECT_EQ(outbox.LastSeq(), 24);
  EXPECT_EQ(outbox.Read(20)->data, MakeRecord(20).data);
}

TEST_F(OutboxTest, GoesOnInMemoryWhenTheFileCannotGrow) {
  rlimit before{};
  getrlimit(RLIMIT_FSIZE, &before);
  std::signal(SIGXFSZ, SIG_IGN);
  {
    Outbox outbox(path_);
    outbox.Append(MakeRecord(0));
    const rlimit small{static_cast<rlim_t>(outbox.FileBytes()) + 500, before.rlim_max};
    setrlimit(RLIMIT_FSIZE, &small);
    outbox.Append(MakeRecord(1));
    outbox.Append(MakeRecord(2, 100));  // this one has room
    outbox.Append(MakeRecord(3));
    setrlimit(RLIMIT_FSIZE, &before);
    for (int64_t seq = 0; seq < 4; ++seq) EXPECT_TRUE(outbox.Read(seq)) << seq;
  }
  Outbox outbox(path_);  // what was in memory only is gone
  EXPECT_TRUE(outbox.Read(0));
  EXPECT_FALSE(outbox.Read(1));
  EXPECT_TRUE(outbox.Read(2));
  EXPECT_FALSE(outbox.Read(3));
}

TEST_F(OutboxTest, WorksInMemoryWithoutAFile) {
  Outbox outbox("");
  outbox.Append(MakeRecord(0));
  outbox.Append(MakeRecord(1));
  outbox.Acknowledge(0);
  EXPECT_EQ(outbox.Read(1)->data, MakeRecord(1).data);
}

}  // namespace outbox_test
}  // namespace mapmend
