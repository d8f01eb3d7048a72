// The picture of the ground: tiles while a flight is mapped, whoever is killed meanwhile, and `mapmend mosaic`.

#include <SQLiteCpp/SQLiteCpp.h>
#include <gtest/gtest.h>

#include <csignal>
#include <filesystem>
#include <fstream>
#include <map>
#include <nlohmann/json.hpp>
#include <tuple>

#include "tests/process/command_helper.h"

namespace mapmend {
namespace mosaic_test {

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
                                   "--seed",
                                   "1",
                                   "--port",
                                   "0",
                                   "--out",
                                   out,
                                   "--session",
                                   "7a0f3c52-61d4-4d0b-8f0e-0c9be5a4e102"};
  argv.insert(argv.end(), more.begin(), more.end());
  return argv;
}

CommandResult Call(std::vector<std::string> arguments) {
  arguments.insert(arguments.begin(), kProgram);
  return RunCommand(arguments, kPatienceS);
}

nlohmann::json Summary(const std::string& out) { return nlohmann::json::parse(ReadText(out + "/summary.json")); }

using Tiles = std::map<std::tuple<int, int, int>, std::string>;

Tiles TilesOf(const std::string& out) {
  Tiles tiles;
  const SQLite::Database file(out + "/mosaic.mbtiles", SQLite::OPEN_READONLY);
  SQLite::Statement row(file, "SELECT zoom_level, tile_column, tile_row, tile_data FROM tiles");
  while (row.executeStep()) {
    const SQLite::Column bytes = row.getColumn(3);
    tiles[{row.getColumn(0).getInt(), row.getColumn(1).getInt(), row.getColumn(2).getInt()}] =
        std::string(static_cast<const char*>(bytes.getBlob()), static_cast<size_t>(bytes.getBytes()));
  }
  return tiles;
}

std::map<std::string, std::string> MetadataOf(const std::string& out) {
  std::map<std::string, std::string> metadata;
  const SQLite::Database file(out + "/mosaic.mbtiles", SQLite::OPEN_READONLY);
  SQLite::Statement row(file, "SELECT name, value FROM metadata");
  while (row.executeStep()) metadata[row.getColumn(0).getString()] = row.getColumn(1).getString();
  return metadata;
}

TEST(Mosaic, TheSameTilesThoughItsProcessIsKilled) {
  const TemporaryFolder folder;
  const CommandResult calm = RunCommand(RunArguments(folder / "calm"), kPatienceS);
  ASSERT_EQ(calm.exit_code, 0) << calm.output;
  const Tiles tiles = TilesOf(folder / "calm");
  EXPECT_GT(tiles.size(), 20u);
  EXPECT_FALSE(fs::exists(folder / "calm/mosaic.mbtiles-wal")) << "one file can be taken along";
  const auto metadata = MetadataOf(folder / "calm");
  EXPECT_EQ(metadata.at("frame"), "local") << "no positions were told";
  const nlohmann::json components = nlohmann::json::parse(metadata.at("components"));
  ASSERT_EQ(components.size(), Summary(folder / "calm").at("components").size());
  EXPECT_TRUE(components[0].at("joined").get<bool>());
  EXPECT_EQ(components[0].at("ground_from_map").size(), 8u);

  RunningCommand run(RunArguments(folder / "shaken"), folder / "output");
  for (int i = 0; i < 5; ++i) {
    SleepSeconds(0.7);
    if (FindProcess(run, "frontend") > 0) KillAndAwaitReturn(run, "mosaic");
  }
  const auto result = run.Wait(kPatienceS);
  ASSERT_TRUE(result) << ReadText(folder / "output");
  ASSERT_EQ(result->exit_code, 0) << result->output;
  EXPECT_TRUE(TilesOf(folder / "shaken") == tiles);
  EXPECT_EQ(MetadataOf(folder / "shaken"), metadata);
  EXPECT_EQ(Call({"db", "hash", folder / "shaken"}).output, Call({"db", "hash", folder / "calm"}).output);
}

TEST(Mosaic, IsMissedByNobodyIfItsProcessCannotStart) {
  const TemporaryFolder folder;
  const fs::path programs = folder / "build/bin";
  fs::create_directories(programs);
  fs::create_symlink(std::string(MAPMEND_SOURCE_DIR) + "/data", folder / "data");
  fs::copy_file(kProgram, programs / "mapmend");
  for (const char* name : {"hub", "frontend", "submap_store", "merger", "viewer_export"})
    fs::create_symlink(std::string(MAPMEND_BIN_DIR) + "/" + name, programs / name);
  std::ofstream(programs / "mosaic") << "#!/bin/sh\necho 'mosaic: no room' >&2\nexit 1\n";
  fs::permissions(programs / "mosaic", fs::perms::owner_all);
  std::vector<std::string> argv = RunArguments(folder / "out");
  argv[0] = programs / "mapmend";
  const CommandResult result = RunCommand(argv, kPatienceS);
  EXPECT_EQ(result.exit_code, 0) << result.output;
  EXPECT_NE(result.output.find("mosaic: no room; it is started again"), std::string::npos) << result.output;
  EXPECT_TRUE(fs::exists(folder / "out/report.html"));
}

TEST(Mosaic, FinalOrNone) {
  const TemporaryFolder folder;
  ASSERT_EQ(RunCommand(RunArguments(folder / "final", {"--mosaic", "final"}), kPatienceS).exit_code, 0);
  EXPECT_FALSE(fs::exists(folder / "final/mosaic.mbtiles"));
  EXPECT_TRUE(fs::exists(folder / "final/mosaic.tif"));
  ASSERT_EQ(RunCommand(RunArguments(folder / "none", {"--mosaic", "none"}), kPatienceS).exit_code, 0);
  EXPECT_FALSE(fs::exists(folder / "none/mosaic.mbtiles"));
  EXPECT_FALSE(fs::exists(folder / "none/mosaic.tif"));
  EXPECT_EQ(Call({"run", kFlight + "video.mp4", "--out", folder / "x", "--mosaic", "later"}).exit_code, 2);

  // A map that is merged anew has what it had, unless told.
  const auto merge = [&](const std::string& out, const std::vector<std::string>& more) {
    std::vector<std::string> arguments = {"merge", out};
    arguments.insert(arguments.end(), more.begin(), more.end());
    ASSERT_EQ(Call(arguments).exit_code, 0);
  };
  merge(folder / "none", {});
  EXPECT_FALSE(fs::exists(folder / "none/mosaic.mbtiles"));
  EXPECT_FALSE(fs::exists(folder / "none/mosaic.tif"));
  merge(folder / "none", {"--mosaic", "live"});
  EXPECT_TRUE(fs::exists(folder / "none/mosaic.mbtiles"));
  EXPECT_TRUE(fs::exists(folder / "none/mosaic.tif"));
  merge(folder / "none", {"--mosaic", "none"});
  for (const char* file : {"mosaic.mbtiles", "mosaic.tif", "mosaic.png", "coverage.png"})
    EXPECT_FALSE(fs::exists(folder / (std::string("none/") + file))) << file << " is of the map as it was";
  merge(folder / "final", {});
  EXPECT_FALSE(fs::exists(folder / "final/mosaic.mbtiles"));
  EXPECT_TRUE(fs::exists(folder / "final/mosaic.tif"));

  // The command, on a map that has one.
  const nlohmann::json before = Summary(folder / "final").at("mosaic");
  const double gsd = before.at("gsd"), west = before.at("west"), north = before.at("north");
  const CommandResult coarser = Call({"mosaic", folder / "final", "--gsd", std::to_string(3 * gsd)});
  ASSERT_EQ(coarser.exit_code, 0) << coarser.output;
  const nlohmann::json coarse = Summary(folder / "final").at("mosaic");
  EXPECT_NEAR(coarse.at("width").get<int>(), before.at("width").get<int>() / 3.0, 2);
  EXPECT_NEAR(coarse.at("gsd").get<double>(), 3 * gsd, 1e-5);
  const double width = 200 * gsd, height = 100 * gsd;
  const std::string bounds = std::to_string(west + width) + "," + std::to_string(north - 3 * height) + "," +
                             std::to_string(west + 2 * width) + "," + std::to_string(north - 2 * height);
  const CommandResult part = Call({"mosaic", folder / "final", "--gsd", std::to_string(gsd), "--bounds", bounds});
  ASSERT_EQ(part.exit_code, 0) << part.output;
  const nlohmann::json cropped = Summary(folder / "final").at("mosaic");
  EXPECT_NEAR(cropped.at("width").get<int>(), 200, 2);
  EXPECT_NEAR(cropped.at("height").get<int>(), 100, 2);
  EXPECT_NEAR(cropped.at("west").get<double>(), west + width, gsd);
}

TEST(Mosaic, SaysWhyThereIsNone) {
  const TemporaryFolder folder;
  const std::string out = folder / "out";
  ASSERT_EQ(RunCommand(RunArguments(out, {"--images", "none"}), kPatienceS).exit_code, 0);
  EXPECT_EQ(MetadataOf(out).at("problem"), "no images of keyframes are stored");
  EXPECT_TRUE(TilesOf(out).empty());
  const CommandResult none = Call({"mosaic", out});
  EXPECT_EQ(none.exit_code, 1);
  EXPECT_NE(none.output.find("no picture of the ground: no images of keyframes are stored"), std::string::npos)
      << none.output;
  for (const std::vector<std::string>& wrong : std::vector<std::vector<std::string>>{{"--gsd", "0"},
                                                                                     {"--gsd", "fine"},
                                                                                     {"--bounds", "1,2,3"},
                                                                                     {"--bounds", "3,0,1,5"},
                                                                                     {"--bounds", "a,b,c,d"}}) {
    CommandResult result = Call({"mosaic", out, wrong[0], wrong[1]});
    EXPECT_EQ(result.exit_code, 2) << wrong[0] << " " << wrong[1] << ": " << result.output;
    EXPECT_NE(result.output.find(wrong[0].substr(2)), std::string::npos) << result.output;
  }
}

}  // namespace mosaic_test
}  // namespace mapmend
