// Sends a synthetic survey to a bus, as a frontend would: to see how store and merger bear a map that grows.
//
//   survey_stream URL NUM_KEYFRAMES KEYFRAMES_PER_SECOND

#include <spdlog/spdlog.h>

#include <chrono>
#include <cstdlib>
#include <thread>

#include "libs/bus/bus.h"
#include "libs/stream/session_id.h"
#include "libs/wire/stream_sender.h"
#include "tests/benchmark/synthetic_survey.h"

int main(int argc, char** argv) {
  using Clock = std::chrono::steady_clock;
  if (argc != 4 || std::atoi(argv[2]) < 50 || std::atof(argv[3]) <= 0) {
    spdlog::error("usage: survey_stream URL NUM_KEYFRAMES KEYFRAMES_PER_SECOND (at least 50, above 0)");
    return 1;
  }
  const std::string session = "00000000-0000-4000-8000-000000000001";
  const auto survey = mapmend::testing::MakeSyntheticSurvey(session, std::atoi(argv[2]));
  mapmend::Bus bus(argv[1], "");
  mapmend::StreamSender sender(&bus, session, {});
  const std::chrono::duration<double> step(1 / std::atof(argv[3]));
  const auto start = Clock::now();
  int num_keyframes = 0;
  for (const mapmend::Record& record : survey->flight->records()) {
    if (std::holds_alternative<mapmend::KeyframeRecord>(record.body)) {
      std::this_thread::sleep_until(start + std::chrono::duration_cast<Clock::duration>(step * num_keyframes++));
      if (num_keyframes % 100 == 0) spdlog::info("{} keyframes", num_keyframes);
    }
    sender.Append(record.header.utime, record.body);
  }
  return sender.Flush(60000) ? 0 : 1;
}
