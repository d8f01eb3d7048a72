#pragma once

#include <gtest/gtest.h>

#include <nlohmann/json.hpp>
#include <string>
#include <vector>

#include "tests/process/command_helper.h"

namespace mapmend {

// A scenario rendered and mapped, in a folder of its own that goes with the object.
struct ScenarioRun {
  TemporaryFolder folder;
  std::string flight = folder / "flight", out = folder / "out";
  nlohmann::json summary;  // null if something failed
  std::string output;      // of the run

  // Options beside the usual ones.
  explicit ScenarioRun(const std::string& scenario, const std::vector<std::string>& of_simulate = {},
                       const std::vector<std::string>& of_run = {}) {
    const std::string program = std::string(MAPMEND_BIN_DIR) + "/mapmend";
    std::vector<std::string> simulate = {program, "simulate", "--quiet", "--scenario", scenario, "--out", flight};
    simulate.insert(simulate.end(), of_simulate.begin(), of_simulate.end());
    const CommandResult rendered = RunCommand(simulate, kPatienceS);
    EXPECT_EQ(rendered.exit_code, 0) << rendered.output;
    std::vector<std::string> run = {program,
                                    "run",
                                    flight + "/video.mp4",
                                    "--camera",
                                    flight + "/camera.yaml",
                                    "--times",
                                    flight + "/times.txt",
                                    "--groundtruth",
                                    flight + "/groundtruth.tum",
                                    "--out",
                                    out,
                                    "--port",
                                    "0",
                                    "--seed",
                                    "1"};
    run.insert(run.end(), of_run.begin(), of_run.end());
    const CommandResult mapped = RunCommand(run, kPatienceS);
    output = mapped.output;
    EXPECT_EQ(mapped.exit_code, 0) << mapped.output;
    if (rendered.exit_code == 0 && mapped.exit_code == 0)
      summary = nlohmann::json::parse(ReadText(out + "/summary.json"));
  }
};

// Its summary; null if something failed.
inline nlohmann::json MapScenario(const std::string& scenario) { return ScenarioRun(scenario).summary; }

}  // namespace mapmend
