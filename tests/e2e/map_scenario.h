#pragma once

#include <gtest/gtest.h>

#include <nlohmann/json.hpp>
#include <string>

#include "tests/process/command_helper.h"

namespace mapmend {

// Renders a scenario and maps it; the summary, null if that failed.
inline nlohmann::json MapScenario(const std::string& scenario) {
  const std::string program = std::string(MAPMEND_BIN_DIR) + "/mapmend";
  const TemporaryFolder folder;
  const std::string flight = folder / "flight", out = folder / "out";
  const CommandResult rendered =
      RunCommand({program, "simulate", "--quiet", "--scenario", scenario, "--out", flight}, 120);
  EXPECT_EQ(rendered.exit_code, 0) << rendered.output;
  const CommandResult run = RunCommand(
      {program, "run", flight + "/video.mp4", "--camera", flight + "/camera.yaml", "--times", flight + "/times.txt",
       "--groundtruth", flight + "/groundtruth.tum", "--out", out, "--port", "0", "--seed", "1"},
      240);
  EXPECT_EQ(run.exit_code, 0) << run.output;
  if (rendered.exit_code != 0 || run.exit_code != 0) return nullptr;
  return nlohmann::json::parse(ReadText(out + "/summary.json"));
}

}  // namespace mapmend
