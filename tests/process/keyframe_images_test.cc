// The images of keyframes: all of them are there at the end, whoever is killed meanwhile, and the map does not depend
// on them.

#include <gtest/gtest.h>

#include <csignal>
#include <cstdlib>
#include <filesystem>
#include <map>
#include <nlohmann/json.hpp>

#include "libs/images/image_file.h"
#include "procs/mapmend/recorder.h"
#include "tests/process/command_helper.h"

namespace mapmend {
namespace keyframe_images_test {

namespace fs = std::filesystem;
const std::string kProgram = std::string(MAPMEND_BIN_DIR) + "/mapmend";
const std::string kFlight = std::string(MAPMEND_SOURCE_DIR) + "/data/flights/sheffield_cross/";

// The end of the first flight and the beginning of the second, which crosses it: two submaps.
std::vector<std::string> RunArguments(const std::string& out, const std::vector<std::string>& more = {}) {
  std::vector<std::string> argv = {kProgram,
                                   "run",
                                   kFlight + "video.mp4",
                                   "--skip-frames",
                                   "0-39,74-83,131-171",
                                   "--session",
                                   "7a0f3c52-61d4-4d0b-8f0e-0c9be5a4e102",
                                   "--seed",
                                   "1",
                                   "--port",
                                   "0",
                                   "--mosaic",
                                   "none",
                                   "--out",
                                   out};
  argv.insert(argv.end(), more.begin(), more.end());
  return argv;
}

CommandResult Call(std::vector<std::string> arguments) {
  arguments.insert(arguments.begin(), kProgram);
  return RunCommand(arguments, kPatienceS);
}

nlohmann::json Info(const std::string& out) {
  return nlohmann::json::parse(Call({"db", "info", "--json", out}).output);
}
nlohmann::json Summary(const std::string& out) { return nlohmann::json::parse(ReadText(out + "/summary.json")); }

std::map<int, std::vector<uint8_t>> Images(const std::string& out) {
  std::map<int, std::vector<uint8_t>> images;
  const ImageFile file(out + "/images.db", ImageFile::Mode::kReadOnly);
  for (const ImageFile::Entry& entry : file.List())
    images[entry.frame] = file.Get(entry.session, entry.keyframe)->bytes;
  return images;
}

void ExpectAllThere(const std::string& out) {
  const nlohmann::json images = Info(out).at("images");
  EXPECT_EQ(images.at("missing").get<int>(), 0) << images;
  EXPECT_GT(images.at("stored").get<int>(), 20);
  EXPECT_EQ(Summary(out).at("images").at("missing").get<int>(), 0);
  EXPECT_EQ(Summary(out).at("images").at("stored"), images.at("stored"));
  EXPECT_FALSE(fs::exists(out + "/outbox.images"));
  const CommandResult check = Call({"db", "check", out});
  EXPECT_EQ(check.exit_code, 0) << check.output;
  // COLMAP's model has them under its names.
  int num_pictures = 0;
  for (const auto& entry : fs::directory_iterator(out + "/colmap/images/0"))
    num_pictures += entry.path().extension() == ".jpg";
  EXPECT_EQ(num_pictures, Summary(out).at("keyframes_in_main").get<int>());
}

TEST(KeyframeImages, AreAllThereThoughStoreAndHubAreKilledAndTheMapIsTheSame) {
  const TemporaryFolder folder;
  const CommandResult calm = RunCommand(RunArguments(folder / "calm"), kPatienceS);
  ASSERT_EQ(calm.exit_code, 0) << calm.output;
  ExpectAllThere(folder / "calm");
  const std::string hash = Call({"db", "hash", folder / "calm"}).output;

  // So slow that images are on their way all the time.
  RunningCommand run(RunArguments(folder / "shaken", {"--image-rate", "8000"}), folder / "output");
  ASSERT_TRUE(WaitUntil([&] { return fs::exists(folder / "shaken/images.db"); }, kPatienceS))
      << ReadText(folder / "output");
  for (int i = 0; i < 3; ++i) {
    for (const std::string program : {"submap_store", "hub"}) {
      SleepSeconds(0.3);
      if (FindProcess(run, "frontend") > 0) KillAndAwaitReturn(run, program);
    }
  }
  const auto result = run.Wait(kPatienceS);
  ASSERT_TRUE(result) << ReadText(folder / "output");
  ASSERT_EQ(result->exit_code, 0) << result->output;
  ExpectAllThere(folder / "shaken");
  EXPECT_EQ(Call({"db", "hash", folder / "shaken"}).output, hash);
  EXPECT_TRUE(Images(folder / "shaken") == Images(folder / "calm"));

  // Without images the map is as good.
  RemoveImageFile(folder / "shaken/images.db");
  EXPECT_EQ(Call({"db", "hash", folder / "shaken"}).output, hash);
  EXPECT_EQ(Call({"db", "check", folder / "shaken"}).exit_code, 0);
  const CommandResult exported = Call({"export", folder / "shaken"});
  EXPECT_EQ(exported.exit_code, 0) << exported.output;
  EXPECT_GT(Summary(folder / "shaken").at("images").at("missing").get<int>(), 20);

  // And without them kept, it is the same.
  ASSERT_EQ(RunCommand(RunArguments(folder / "none", {"--images", "none"}), kPatienceS).exit_code, 0);
  EXPECT_EQ(Call({"db", "hash", folder / "none"}).output, hash);
  EXPECT_FALSE(fs::exists(folder / "none/images.db"));
}

// The number behind a name in what COLMAP says; -1 if it does not say it.
double Figure(const std::string& text, const std::string& name) {
  const size_t at = text.find(name + ": ");
  return at == std::string::npos ? -1 : std::atof(text.c_str() + at + name.size() + 2);
}

TEST(KeyframeImages, ColmapReadsThemWithItsModel) {
  const std::string colmap = FindOnPath("colmap");
  if (colmap.empty()) GTEST_SKIP() << "colmap is not installed";
  setenv("QT_QPA_PLATFORM", "offscreen", 1);
  const TemporaryFolder folder;
  ASSERT_EQ(RunCommand(RunArguments(folder / "out"), kPatienceS).exit_code, 0);
  const nlohmann::json summary = Summary(folder / "out");
  for (const char* model : {"/colmap", "/colmap/sparse/0"}) {
    const CommandResult told = RunCommand({colmap, "model_analyzer", "--path", folder / "out" + model}, kPatienceS);
    ASSERT_EQ(told.exit_code, 0) << told.output;
    EXPECT_EQ(Figure(told.output, "Registered images"), summary.at("keyframes_in_main").get<int>()) << told.output;
    EXPECT_GT(Figure(told.output, "Points"), 0.95 * summary.at("points_in_main").get<int>()) << told.output;
    EXPECT_GT(Figure(told.output, "Mean reprojection error"), 0) << told.output;
    EXPECT_LT(Figure(told.output, "Mean reprojection error"), 1) << told.output;
  }
  const CommandResult undistorted =
      RunCommand({colmap, "image_undistorter", "--image_path", folder / "out/colmap/images", "--input_path",
                  folder / "out/colmap/sparse/0", "--output_path", folder / "dense"},
                 kPatienceS);
  EXPECT_EQ(undistorted.exit_code, 0) << undistorted.output;
  int num_images = 0;
  for (const auto& entry : fs::directory_iterator(folder / "dense/images/0")) num_images += entry.is_regular_file();
  EXPECT_EQ(num_images, summary.at("keyframes_in_main").get<int>());
}

TEST(KeyframeImages, OfAFrontendThatIsKilledAreTakenFromTheInputOnceMore) {
  const TemporaryFolder folder;
  RunningCommand run(RunArguments(folder / "out"), folder / "output");
  const auto num_bytes = [&] {
    return ReadText(folder / "out/map.db-wal").size() + ReadText(folder / "out/map.db").size();
  };
  for (const size_t bytes : {600000, 1200000}) {
    ASSERT_TRUE(WaitUntil([&] { return num_bytes() > bytes || FindProcess(run, "frontend") < 0; }, kPatienceS));
    if (FindProcess(run, "frontend") < 0) break;
    KillAndAwaitReturn(run, "frontend");
  }
  const auto result = run.Wait(kPatienceS);
  ASSERT_TRUE(result) << ReadText(folder / "output");
  ASSERT_EQ(result->exit_code, 0) << result->output;
  const nlohmann::json images = Info(folder / "out").at("images");
  EXPECT_EQ(images.at("missing").get<int>(), 0) << images;
}

TEST(KeyframeImages, OfAFlightThatIsCutOffAreRecovered) {
  const TemporaryFolder folder;
  {
    // Next to nothing gets through before the end.
    RunningCommand run(RunArguments(folder / "out", {"--image-rate", "10"}), folder / "output");
    ASSERT_TRUE(WaitUntil([&] { return ReadText(folder / "out/map.db-wal").size() > 1000000; }, kPatienceS))
        << ReadText(folder / "output");
    run.Signal(SIGKILL);
    run.Wait(30);
    EXPECT_EQ(run.SurvivorsAfter(60), std::vector<pid_t>());
  }
  ASSERT_TRUE(fs::exists(folder / "out/outbox.images"));
  const CommandResult recovered = Call({"recover", folder / "out"});
  ASSERT_EQ(recovered.exit_code, 0) << recovered.output;
  const nlohmann::json images = Info(folder / "out").at("images");
  EXPECT_GT(images.at("stored").get<int>(), 5);
  // Of the last keyframe the image may not have been in the spool when the power went.
  EXPECT_LE(images.at("missing").get<int>(), 1) << images;
  EXPECT_FALSE(fs::exists(folder / "out/outbox.images"));
}

}  // namespace keyframe_images_test
}  // namespace mapmend
