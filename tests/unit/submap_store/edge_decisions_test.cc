#include "procs/submap_store/edge_decisions.h"

#include <gtest/gtest.h>

#include <filesystem>
#include <stdexcept>

#include "procs/submap_store/db_commands.h"
#include "procs/submap_store/submap_store.h"
#include "tests/scratch_folder.h"
#include "tests/synthetic_stream.h"

namespace mapmend {
namespace edge_decisions_test {

EdgeDecision Decision(int a, int b, bool disabled, const std::string& session = "s") {
  return {{session, SubmapId(a)}, {session, SubmapId(b)}, disabled};
}

EdgeRequest Request(const std::vector<EdgeDecision>& decisions) { return {{7, "test"}, decisions}; }

class EdgeDecisionsTest : public ::testing::Test {
 protected:
  ScratchFolder folder_;
  std::string db_ = folder_.File("map.db");
};

TEST_F(EdgeDecisionsTest, AreKeptInOrderAndSurviveARestart) {
  {
    Database database(db_, Database::Mode::kReadWrite);
    EdgeDecisions decisions(&database);
    EXPECT_EQ(decisions.Decide(Request({})).decisions.size(), 0u);
    const EdgeAnswer reply = decisions.Decide(Request({Decision(0, 2, true), Decision(1, 2, true)}));
    EXPECT_EQ(reply.id, 7);
    EXPECT_EQ(reply.requester, "test");
    EXPECT_EQ(reply.decisions.size(), 2u);
    EXPECT_EQ(decisions.Decide(Request({Decision(2, 1, false)})).decisions.size(), 3u);
  }
  Database database(db_, Database::Mode::kReadWrite);
  const std::vector<EdgeDecision> all = EdgeDecisions(&database).All();
  ASSERT_EQ(all.size(), 3u);
  EXPECT_EQ(all[0].b.submap, SubmapId(2));
  EXPECT_EQ(all[2].a.submap, SubmapId(2));
  EXPECT_FALSE(all[2].disabled);
}

TEST_F(EdgeDecisionsTest, WhatIsSoAlreadyIsNotAdded) {
  Database database(db_, Database::Mode::kReadWrite);
  EdgeDecisions decisions(&database);
  EXPECT_EQ(decisions.Decide(Request({Decision(0, 1, false)})).decisions.size(), 0u);  // nothing was switched off
  EXPECT_EQ(decisions.Decide(Request({Decision(0, 1, true), Decision(1, 0, true)})).decisions.size(), 1u);
  EXPECT_EQ(decisions.Decide(Request({Decision(1, 0, false), Decision(0, 1, true)})).decisions.size(), 3u);
}

TEST_F(EdgeDecisionsTest, NonsenseIsRefusedAndNothingOfItKept) {
  Database database(db_, Database::Mode::kReadWrite);
  EdgeDecisions decisions(&database);
  for (const EdgeDecision& bad : {Decision(1, 1, true), Decision(-1, 2, true), Decision(0, 1, true, "no/session")}) {
    EXPECT_THROW(decisions.Decide(Request({Decision(0, 1, true), bad})), std::runtime_error);
  }
  EXPECT_TRUE(decisions.All().empty());
}

TEST_F(EdgeDecisionsTest, GoIntoAMergedDatabase) {
  const std::string other = folder_.File("other.db"), merged = folder_.File("merged.db");
  for (const auto& [path, session] : {std::pair(db_, "s"), std::pair(other, "longer")}) {
    SubmapStoreOptions options;
    options.path = path;
    SubmapStore store(options);
    SyntheticStreamOptions flight;
    flight.session = session;
    for (const Record& record : MakeSyntheticStream(flight)) {
      const EncodedRecord encoded = EncodeRecord(record);
      store.OnRecord(encoded.channel, encoded.data.data(), static_cast<int>(encoded.data.size()), 0);
    }
    store.CommitReady(0);
    store.edge_decisions()->Decide(Request({Decision(0, 1, true, session)}));
  }
  MergeDbs({db_, other}, merged);
  Database database(merged, Database::Mode::kReadWrite);
  const std::vector<EdgeDecision> all = EdgeDecisions(&database).All();
  ASSERT_EQ(all.size(), 2u);
  EXPECT_EQ(all[0].a.session, "s");
  EXPECT_EQ(all[1].a.session, "longer");
}

}  // namespace edge_decisions_test
}  // namespace mapmend
