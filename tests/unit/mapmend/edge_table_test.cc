#include "procs/mapmend/edge_table.h"

#include <gtest/gtest.h>

#include <nlohmann/json.hpp>
#include <stdexcept>

namespace mapmend {
namespace edge_table_test {

GraphReply TwoFlights() {
  GraphReply graph;
  for (const auto& [session, submap] : {std::pair("ab2", 0), std::pair("ab1", 1), std::pair("ab1", 0)}) {
    graph.transforms.submaps.push_back({{session, SubmapId(submap)}, 0, {}, false});
  }
  EvaluatedConnection weak, strong;
  weak.a = strong.a = {"ab1", SubmapId(0)};
  weak.b = {"ab1", SubmapId(1)};
  weak.reason = "only 7 map points look alike";
  strong.b = {"ab2", SubmapId(0)};
  strong.strength = 33.5;
  strong.num_connected_frames = 4;
  strong.b_from_a.scale = 1.25;
  strong.verdict = EvaluatedConnection::Verdict::kAccepted;
  strong.in_tree = true;
  graph.connections = {weak, strong};
  return graph;
}

TEST(EdgeTable, NumbersSubmapsBySessionAndFindsThem) {
  const EdgeTable table(TwoFlights(), {"ab1", "ab2"});
  EXPECT_EQ(table.FindSubmap("0"), (SubmapKey{"ab1", SubmapId(0)}));
  EXPECT_EQ(table.FindSubmap("1"), (SubmapKey{"ab1", SubmapId(1)}));
  EXPECT_EQ(table.FindSubmap("2"), (SubmapKey{"ab2", SubmapId(0)}));
  EXPECT_EQ(table.FindSubmap("ab2:0"), (SubmapKey{"ab2", SubmapId(0)}));
  EXPECT_EQ(table.FindSubmap("ab:1"), (SubmapKey{"ab1", SubmapId(1)}));  // the only one of that number
  EXPECT_THROW(table.FindSubmap("ab:0"), std::runtime_error);
  for (const char* bad : {"3", "-1", "", "ab1:", "ab3:0", "1x"})
    EXPECT_THROW(table.FindSubmap(bad), std::runtime_error) << bad;
}

TEST(EdgeTable, ListsTheStrongestFirstAndWhatIsSwitchedOff) {
  const EdgeDecision off{{"ab2", SubmapId(0)}, {"ab1", SubmapId(0)}, true};
  const EdgeDecision on{{"ab2", SubmapId(0)}, {"ab1", SubmapId(1)}, true}, undone{on.a, on.b, false};
  const std::string text = EdgeTable(TwoFlights(), {"ab1", "ab2"}).Text({off, on, undone});
  EXPECT_LT(text.find("0 - 2"), text.find("0 - 1")) << text;
  EXPECT_NE(text.find("1.250"), std::string::npos) << text;
  EXPECT_NE(text.find("only 7 map points look alike"), std::string::npos) << text;
  EXPECT_NE(text.find("switched off by hand: 0 - 2\n"), std::string::npos) << text;
  EXPECT_EQ(text.find("switched off by hand: 1 - 2"), std::string::npos) << text;
  EXPECT_NE(text.find("submaps from 2 on: session ab2"), std::string::npos) << text;
}

TEST(EdgeTable, SaysTheSameAsJson) {
  const EdgeDecision off{{"ab2", SubmapId(0)}, {"ab1", SubmapId(0)}, true};
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

}  // namespace edge_table_test
}  // namespace mapmend
