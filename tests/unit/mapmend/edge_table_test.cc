#include "procs/mapmend/edge_table.h"

#include <gtest/gtest.h>

#include <nlohmann/json.hpp>
#include <stdexcept>

namespace mapmend {
namespace {

graph_t TwoFlights() {
  graph_t graph{};
  for (const auto& [session, submap] : {std::pair("ab2", 0), std::pair("ab1", 1), std::pair("ab1", 0)}) {
    merged_submap_t s{};
    s.session = session;
    s.submap = submap;
    graph.transforms.submaps.push_back(s);
  }
  connection_t weak{}, strong{};
  weak.session_a = strong.session_a = "ab1";
  weak.session_b = "ab1";
  weak.submap_b = 1;
  weak.verdict = connection_t::REJECTED;
  weak.reason = "only 7 map points look alike";
  strong.session_b = "ab2";
  strong.strength = 33.5;
  strong.num_connected_frames = 4;
  strong.b_from_a[7] = 1.25;
  strong.verdict = connection_t::ACCEPTED;
  strong.in_tree = 1;
  graph.connections = {weak, strong};
  return graph;
}

TEST(EdgeTable, NumbersSubmapsBySessionAndFindsThem) {
  const EdgeTable table(TwoFlights(), {"ab1", "ab2"});
  EXPECT_EQ(table.FindSubmap("0"), std::pair(std::string("ab1"), 0));
  EXPECT_EQ(table.FindSubmap("1"), std::pair(std::string("ab1"), 1));
  EXPECT_EQ(table.FindSubmap("2"), std::pair(std::string("ab2"), 0));
  EXPECT_EQ(table.FindSubmap("ab2:0"), std::pair(std::string("ab2"), 0));
  EXPECT_EQ(table.FindSubmap("ab:1"), std::pair(std::string("ab1"), 1));  // the only one of that number
  EXPECT_THROW(table.FindSubmap("ab:0"), std::runtime_error);
  for (const char* bad : {"3", "-1", "", "ab1:", "ab3:0", "1x"})
    EXPECT_THROW(table.FindSubmap(bad), std::runtime_error) << bad;
}

TEST(EdgeTable, ListsTheStrongestFirstAndWhatIsSwitchedOff) {
  edge_decision_t off{}, on{};
  off.session_a = "ab2";
  off.session_b = "ab1";
  off.disabled = 1;
  on = off;
  on.submap_b = 1;
  edge_decision_t undone = on;
  undone.disabled = 0;
  const std::string text = EdgeTable(TwoFlights(), {"ab1", "ab2"}).Text({off, on, undone});
  EXPECT_LT(text.find("0 - 2"), text.find("0 - 1")) << text;
  EXPECT_NE(text.find("1.250"), std::string::npos) << text;
  EXPECT_NE(text.find("only 7 map points look alike"), std::string::npos) << text;
  EXPECT_NE(text.find("switched off by hand: 0 - 2\n"), std::string::npos) << text;
  EXPECT_EQ(text.find("switched off by hand: 1 - 2"), std::string::npos) << text;
  EXPECT_NE(text.find("submaps from 2 on: session ab2"), std::string::npos) << text;
}

TEST(EdgeTable, SaysTheSameAsJson) {
  edge_decision_t off{};
  off.session_a = "ab2";
  off.session_b = "ab1";
  off.disabled = 1;
  const auto json = nlohmann::json::parse(EdgeTable(TwoFlights(), {"ab1", "ab2"}).Json({off}));
  ASSERT_EQ(json.at("submaps").size(), 3u);
  EXPECT_EQ(json["submaps"][2]["session"], "ab2");
  EXPECT_EQ(json["submaps"][2]["number"], 2);
  ASSERT_EQ(json.at("edges").size(), 2u);
  EXPECT_EQ(json["edges"][0]["b"], 2);
  EXPECT_EQ(json["edges"][0]["verdict"], "accepted");
  EXPECT_EQ(json["edges"][0]["in_tree"], true);
  EXPECT_EQ(json["edges"][1]["reason"], "only 7 map points look alike");
  EXPECT_EQ(json.at("switched_off"), nlohmann::json::parse("[[0, 2]]"));
}

}  // namespace
}  // namespace mapmend
