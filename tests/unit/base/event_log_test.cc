#include "libs/base/event_log.h"

#include <gtest/gtest.h>
#include <unistd.h>

#include <cstdio>
#include <fstream>
#include <nlohmann/json.hpp>

namespace mapmend {
namespace event_log_test {

using Json = nlohmann::ordered_json;

TEST(EventLog, AddsALineForEachEvent) {
  const std::string path = testing::TempDir() + "/events_" + std::to_string(getpid()) + ".jsonl";
  {
    EventLog first(path, "frontend"), second(path, "mapmend");
    first.Add("lost", {{"frame", 73}, {"reason", "blur"}});
    second.Add("joined", {{"text", "a \"quoted\"\nname"}});
  }
  {
    EventLog again(path, "frontend");  // what is there stays
    again.Add("end", Json::object());
  }
  std::ifstream file(path);
  std::vector<Json> events;
  for (std::string line; std::getline(file, line);) events.push_back(Json::parse(line));
  ASSERT_EQ(events.size(), 3u);
  EXPECT_EQ(events[0]["process"], "frontend");
  EXPECT_EQ(events[0]["event"], "lost");
  EXPECT_EQ(events[0]["frame"], 73);
  EXPECT_EQ(events[0]["time"].get<std::string>().size(), std::string("2026-04-29T12:14:18.250Z").size());
  EXPECT_EQ(events[1]["text"], "a \"quoted\"\nname");
  EXPECT_EQ(events[2]["event"], "end");
  std::remove(path.c_str());
}

TEST(EventLog, AFileThatCannotBeWrittenEndsNothing) {
  EventLog none("", "frontend"), no_folder("/no/such/folder/events.jsonl", "frontend"), full("/dev/full", "frontend");
  for (EventLog* log : {&none, &no_folder, &full}) log->Add("end", Json::object());
}

TEST(FormatUtime, IsATimeOfDayIfItIsADate) {
  EXPECT_EQ(FormatUtime(1525004058250000), "12:14:18");
  EXPECT_EQ(FormatUtime(73250000), "73.250 s");
}

}  // namespace event_log_test
}  // namespace mapmend
