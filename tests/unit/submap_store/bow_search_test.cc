#include "procs/submap_store/bow_search.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <set>

#include "procs/submap_store/submap_store.h"
#include "tests/scratch_folder.h"
#include "tests/synthetic_stream.h"

namespace mapmend {
namespace bow_search_test {

// Three submaps over the same ten places: keyframe 10 s + p is at place p in submap s. A second flight sees them, too.
class BowSearchTest : public ::testing::Test {
 protected:
  BowSearchTest() {
    Fill("first", 3);
    Fill("second", 1);
    database_ = std::make_unique<Database>(path_, Database::Mode::kReadOnly);
    search_ = std::make_unique<BowSearch>(BowSearchOptions(), database_.get());
    search_->Load();
  }
  void Fill(const std::string& session, int num_submaps) {
    SubmapStoreOptions options;
    options.path = path_;
    SubmapStore store(options);
    SyntheticStreamOptions flight;
    flight.session = session;
    flight.num_submaps = num_submaps;
    flight.num_words = 800;  // so many that which of them are noise does not decide
    flight.seed = static_cast<unsigned>(num_submaps);
    for (const Record& record : MakeSyntheticStream(flight)) {
      const EncodedRecord encoded = EncodeRecord(record);
      store.OnRecord(encoded.channel, encoded.data.data(), static_cast<int>(encoded.data.size()), 0);
    }
    store.CommitReady(0);
    while (store.WorkInBackground()) continue;
  }
  static BowQuery About(int keyframe, const std::vector<StreamCursor>& cursors) {
    BowQuery query;
    query.session = "first";
    query.keyframe = KeyframeId(keyframe);
    query.cursors = cursors;
    return query;
  }
  // Session and keyframe of what is proposed.
  std::set<std::pair<std::string, int>> Ask(const BowQuery& query) {
    const BowAnswer answer = search_->Query(query);
    EXPECT_EQ(answer.status, BowAnswer::Status::kOk);
    std::set<std::pair<std::string, int>> found;
    for (const BowProposal& p : answer.proposals) found.emplace(p.session, p.keyframe.value);
    EXPECT_EQ(found.size(), answer.proposals.size());
    return found;
  }
  // Of the record with a keyframe of the first flight, which is the third of its place.
  static int64_t SeqOf(int keyframe) { return 1 + 32 * (keyframe / 10) + 2 + 3 * (keyframe % 10); }

  ScratchFolder folder_;
  std::string path_ = folder_.File("map.db");
  std::unique_ptr<Database> database_;
  std::unique_ptr<BowSearch> search_;
  const std::vector<StreamCursor> all_ = {{"first", SeqOf(29) + 3}, {"second", SeqOf(9) + 3}};
};

TEST_F(BowSearchTest, TheSamePlaceIsFoundInEveryOtherSubmapAndFlight) {
  const auto found = Ask(About(14, all_));
  EXPECT_TRUE(found.contains({"first", 4}));
  EXPECT_TRUE(found.contains({"first", 24}));
  EXPECT_TRUE(found.contains({"second", 4}));
  for (const auto& [session, keyframe] : found) {
    EXPECT_FALSE(session == "first" && keyframe / 10 == 1) << "of its own submap: " << keyframe;
  }
}

TEST_F(BowSearchTest, TheBestComesFirstAndNoMoreThanAskedFor) {
  BowQuery query = About(14, all_);
  const BowAnswer many = search_->Query(query);
  ASSERT_GE(many.proposals.size(), 3u);
  for (size_t i = 1; i < many.proposals.size(); ++i)
    EXPECT_GE(many.proposals[i - 1].group_score, many.proposals[i].group_score) << i;
  EXPECT_EQ(many.best_group_score, many.proposals[0].group_score);
  query.max_results = 2;
  const BowAnswer few = search_->Query(query);
  EXPECT_EQ(few.proposals, std::vector<BowProposal>(many.proposals.begin(), many.proposals.begin() + 2));
}

TEST_F(BowSearchTest, ASessionThatIsNotNamedIsNotSearched) {
  for (const auto& [session, keyframe] : Ask(About(14, {all_[0]}))) EXPECT_EQ(session, "first") << keyframe;
}

TEST_F(BowSearchTest, WhatCameLaterIsNotFound) {
  const auto before = Ask(About(14, {{"first", SeqOf(24) - 1}}));
  EXPECT_TRUE(before.contains({"first", 4}));
  EXPECT_FALSE(before.contains({"first", 24}));
  EXPECT_TRUE(Ask(About(14, {all_[0]})).contains({"first", 24}));
}

TEST_F(BowSearchTest, AKeyframeThatWasRemovedIsFoundAsOfBefore) {
  const int64_t last = all_[0].seq;
  for (const SessionRow& row : database_->Sessions()) {
    if (row.uuid == "first") search_->RemoveKeyframe(row.id, KeyframeId(4), last);
  }
  EXPECT_FALSE(Ask(About(14, {{"first", last}})).contains({"first", 4}));
  EXPECT_TRUE(Ask(About(14, {{"first", last - 1}})).contains({"first", 4}));
}

TEST_F(BowSearchTest, WithinASubmapTheNeighboursAreLeftOut) {
  BowQuery query = About(14, all_);
  query.same_submap = true;
  const auto found = Ask(query);
  EXPECT_FALSE(found.contains({"first", 14})) << "itself";
  EXPECT_FALSE(found.contains({"first", 13})) << "the one before";
  EXPECT_FALSE(found.contains({"first", 15})) << "covisible";
}

TEST_F(BowSearchTest, TheThresholdsAreThoseOfItsNeighbours) {
  const BowAnswer answer = search_->Query(About(14, all_));
  EXPECT_EQ(answer.adjacent, KeyframeId(13));
  EXPECT_EQ(answer.nearby.value / 10, 1) << "of its submap";
  EXPECT_NE(answer.nearby, answer.adjacent);
  EXPECT_GT(answer.n0, answer.n1);
  EXPECT_FALSE(search_->Query(About(10, all_)).adjacent.IsValid()) << "the first of its submap";
}

TEST_F(BowSearchTest, SaysWhyThereIsNoAnswer) {
  const auto status = [&](int keyframe, const std::vector<StreamCursor>& cursors) {
    return search_->Query(About(keyframe, cursors)).status;
  };
  EXPECT_EQ(status(14, all_), BowAnswer::Status::kOk);
  EXPECT_EQ(status(14, {{"first", all_[0].seq + 100}}), BowAnswer::Status::kNotYet);
  EXPECT_EQ(status(14, {all_[0], {"unknown", 0}}), BowAnswer::Status::kNotYet);
  EXPECT_EQ(status(14, {{"../first", 3}}), BowAnswer::Status::kBadQuery);
  EXPECT_EQ(status(14, {all_[1]}), BowAnswer::Status::kBadQuery) << "its own session is not named";
  EXPECT_EQ(status(99, all_), BowAnswer::Status::kUnknownKeyframe);
  EXPECT_EQ(status(24, {{"first", SeqOf(24) - 1}}), BowAnswer::Status::kUnknownKeyframe) << "not as of then";
}

TEST_F(BowSearchTest, TheAnswerIsToTheOneWhoAsked) {
  BowQuery query = About(14, all_);
  query.id = 7;
  query.requester = "merger-1";
  const BowAnswer answer = search_->Query(query);
  EXPECT_EQ(answer.id, 7);
  EXPECT_EQ(answer.requester, "merger-1");
  EXPECT_EQ(answer.session, "first");
  EXPECT_EQ(answer.keyframe, KeyframeId(14));
}

}  // namespace bow_search_test
}  // namespace mapmend
