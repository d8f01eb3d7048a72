#include "libs/command_line/command_line.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <CLI/CLI.hpp>

#include "libs/command_line/help_format.h"

namespace mapmend {
namespace command_line_test {

using testing::HasSubstr;
using testing::StartsWith;

struct Parsed {
  std::optional<int> code;
  std::string error;
};

// A program like mapmend: commands, one of them with commands of its own.
class CommandLineTest : public testing::Test {
 protected:
  Parsed Parse(std::vector<std::string> words) {
    CLI::App app("does things", "mapmend");
    app.require_subcommand(0, 1);
    CLI::App* run = app.add_subcommand("run", "maps");
    run->add_option("INPUT", input_, "a video");
    run->add_option("--camera", camera_, "its calibration");
    run->add_option("--lost-frames", number_, "how many")->check(CLI::Range(1, 100));
    run->add_option("--seed", number_, "of everything random");
    auto* live = run->add_flag("--live", flag_, "from a camera");
    run->add_flag("--realtime", flag_, "at its pace")->excludes(live);
    run->callback([this] {
      if (exit_code_ != 0) throw CLI::RuntimeError(exit_code_);
    });
    CLI::App* edges = app.add_subcommand("edges", "connections");
    edges->require_subcommand(1);
    edges->add_subcommand("list", "all")->add_option("MAP", input_, "a folder")->required();
    edges->add_subcommand("disable", "one");
    std::vector<char*> argv;
    for (std::string& word : words) argv.push_back(word.data());
    testing::internal::CaptureStderr();
    testing::internal::CaptureStdout();
    Parsed parsed;
    parsed.code = ParseCommandLine(&app, static_cast<int>(argv.size()), argv.data());
    output_ = testing::internal::GetCapturedStdout();
    parsed.error = testing::internal::GetCapturedStderr();
    return parsed;
  }
  void ExpectMistake(const std::vector<std::string>& words, const std::string& line) {
    const Parsed parsed = Parse(words);
    EXPECT_EQ(parsed.code, kExitUsage);
    EXPECT_EQ(parsed.error, line + "\n");
  }

  std::string input_, camera_, output_;
  int number_ = 0, exit_code_ = 0;
  bool flag_ = false;
};

TEST_F(CommandLineTest, AGoodLineGoesOn) {
  const Parsed parsed = Parse({"mapmend", "run", "a.mp4", "--camera", "c.yaml"});
  EXPECT_EQ(parsed.code, std::nullopt);
  EXPECT_EQ(parsed.error, "");
  EXPECT_EQ(camera_, "c.yaml");
}

TEST_F(CommandLineTest, TheExitCodeOfACallbackPasses) {
  exit_code_ = 4;
  EXPECT_EQ(Parse({"mapmend", "run", "a.mp4"}).code, 4);
}

TEST_F(CommandLineTest, MisspeltWordsGetASuggestion) {
  ExpectMistake({"mapmend", "rnu", "a.mp4"},
                "mapmend: no command 'rnu'; did you mean run? ('mapmend --help' lists all)");
  ExpectMistake({"mapmend", "run", "--camra", "c.yaml", "a.mp4"},
                "mapmend: run: no option --camra; did you mean --camera? ('mapmend run --help' lists all)");
  ExpectMistake({"mapmend", "edges", "disabel", "x"},
                "mapmend: edges: no command 'disabel'; did you mean disable? ('mapmend edges --help' lists all)");
  ExpectMistake({"mapmend", "run", "--wings"}, "mapmend: run: no option --wings ('mapmend run --help' lists all)");
}

TEST_F(CommandLineTest, OneLineForEveryOtherMistake) {
  ExpectMistake({"mapmend", "run", "a", "b"},
                "mapmend: run: 'b' is one argument too many ('mapmend run --help' lists all)");
  ExpectMistake({"mapmend", "run", "--seed", "x"},
                "mapmend: run: --seed: 'x' is not a number ('mapmend run --help' lists all)");
  ExpectMistake({"mapmend", "run", "--lost-frames", "0"},
                "mapmend: run: --lost-frames: 0 not in range 1 to 100 ('mapmend run --help' lists all)");
  ExpectMistake({"mapmend", "run", "--camera"},
                "mapmend: run: --camera needs a value ('mapmend run --help' lists all)");
  ExpectMistake({"mapmend", "edges"}, "mapmend: edges: a command is missing ('mapmend edges --help' lists all)");
  ExpectMistake({"mapmend", "edges", "list"},
                "mapmend: edges list: MAP is missing ('mapmend edges list --help' lists all)");
  const Parsed both = Parse({"mapmend", "run", "--live", "--realtime"});
  EXPECT_EQ(both.code, kExitUsage);
  EXPECT_THAT(both.error, HasSubstr(" does not go with "));
}

TEST_F(CommandLineTest, HelpNamesWhatIsWanted) {
  EXPECT_EQ(Parse({"mapmend", "run", "--help"}).code, 0);
  EXPECT_THAT(output_, HasSubstr("--camera FILE"));
  EXPECT_THAT(output_, HasSubstr("--lost-frames N (1 to 100)"));
  EXPECT_THAT(output_, HasSubstr("Usage: mapmend run"));
}

TEST_F(CommandLineTest, AProgramThatMapmendStartedSpeaksInItsName) {
  std::string called = "mapmend db", plain = "/usr/libexec/mapmend/submap_store";
  char* argv[] = {called.data(), nullptr};
  EXPECT_EQ(ProgramName("submap_store", 1, argv), "mapmend db");
  EXPECT_EQ(ErrorPrefix("mapmend db"), "mapmend: db: ");
  argv[0] = plain.data();
  EXPECT_EQ(ProgramName("submap_store", 1, argv), "submap_store");
  EXPECT_EQ(ErrorPrefix("submap_store"), "submap_store: ");
}

}  // namespace command_line_test
}  // namespace mapmend
