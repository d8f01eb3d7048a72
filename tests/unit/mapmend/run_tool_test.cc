#include "procs/mapmend/run_tool.h"

#include <gtest/gtest.h>

#include <filesystem>
#include <fstream>
#include <string>

#include "libs/base/write_file.h"
#include "tests/scratch_folder.h"

namespace mapmend {
namespace run_tool_test {

namespace fs = std::filesystem;

// Writes a program of the shell that notes each of its runs, and then does what script says.
class RunToolTest : public testing::Test {
 protected:
  std::string Tool(const std::string& script) {
    const std::string path = folder_.File("tool");
    std::ofstream(path) << "#!/bin/sh\necho >> " << Runs() << "\n" << script << "\n";
    fs::permissions(path, fs::perms::owner_all);
    return path;
  }
  std::string Runs() const { return folder_.File("runs"); }
  std::string Log() const { return folder_.File("log"); }
  int NumRuns() const { return static_cast<int>(fs::file_size(Runs())); }
  // What RunTool throws; "" if nothing.
  std::string Failure(const std::string& tool) const {
    try {
      RunTool({tool}, Log(), "cannot do it");
    } catch (const std::runtime_error& error) {
      return error.what();
    }
    return "";
  }

  ScratchFolder folder_;
};

TEST_F(RunToolTest, WhatIsKilledIsRunAgain) {
  EXPECT_EQ(Failure(Tool("[ $(wc -c < " + Runs() + ") -ge 3 ] || kill -9 $$")), "");
  EXPECT_EQ(NumRuns(), 3);
}

// A log may be that of a whole flight, with troubles of its own; and what is said is read by those who asked.
TEST_F(RunToolTest, WhatItSaidBeforeItWasKilledIsTakenOff) {
  std::ofstream(Log()) << "[error] long ago\n";
  EXPECT_EQ(Failure(Tool("echo said; [ $(wc -c < " + Runs() + ") -ge 3 ] || kill -9 $$")), "");
  EXPECT_EQ(ReadFile(Log()), "[error] long ago\nsaid\n");
  EXPECT_NE(Failure(Tool("echo \"[error] the disk is full\"; exit 1")).find("the disk is full"), std::string::npos);
}

TEST_F(RunToolTest, WhatFailsByItselfIsNot) {
  const std::string tool = Tool("echo \"[error] the disk is full\"; exit 1");
  EXPECT_NE(Failure(tool).find("cannot do it: "), std::string::npos);
  EXPECT_NE(Failure(tool).find("the disk is full"), std::string::npos);
  EXPECT_EQ(NumRuns(), 2);  // one for each call
}

TEST_F(RunToolTest, WhatIsKilledEachTimeIsTold) {
  const std::string failure = Failure(Tool("kill -9 $$"));
  EXPECT_NE(failure.find("cannot do it: "), std::string::npos) << failure;
  EXPECT_NE(failure.find("signal 9"), std::string::npos) << failure;
  EXPECT_EQ(NumRuns(), 10);
}

}  // namespace run_tool_test
}  // namespace mapmend
