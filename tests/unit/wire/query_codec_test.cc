#include "libs/wire/query_codec.h"

#include <gtest/gtest.h>

#include <mapmend/bow_result_t.hpp>
#include <mapmend/fetched_t.hpp>
#include <mapmend/progress_t.hpp>
#include <mapmend/revision_fetched_t.hpp>
#include <mapmend/session_closed_t.hpp>

#include "tests/unit/wire/random_values.h"

namespace mapmend {
namespace query_codec_test {

Addressed RandomAddress(RandomValues* random) { return {random->Seq(), random->Text()}; }

template <typename Status>
Status RandomStatus(Status last, RandomValues* random) {
  return static_cast<Status>(random->Int(0, static_cast<int>(last)));
}

KeyframeId RandomKeyframe(RandomValues* random) { return KeyframeId(random->Int(-1, 1 << 30)); }

std::vector<StreamCursor> RandomCursors(RandomValues* random) {
  return random->List<StreamCursor>(5, [&] { return random->Cursor(); });
}

BowQuery RandomQuery(RandomValues* random) {
  return {RandomAddress(random),
          {random->Text(), RandomKeyframe(random), RandomCursors(random), random->Int(0, 99), random->Bool()}};
}

BowAnswer RandomBowAnswer(RandomValues* random) {
  BowAnswer answer;
  static_cast<Addressed&>(answer) = RandomAddress(random);
  answer.status = RandomStatus(BowAnswer::Status::kBadQuery, random);
  answer.session = random->Session();
  answer.keyframe = RandomKeyframe(random);
  answer.adjacent = RandomKeyframe(random);
  answer.nearby = RandomKeyframe(random);
  answer.n0 = random->Int(0, 1000);
  answer.n1 = random->Int(0, 1000);
  for (float* value : {&answer.k, &answer.s0, &answer.s1, &answer.l, &answer.best_group_score})
    *value = random->Float();
  answer.max_common_words = random->Int(0, 1000);
  answer.proposals = random->List<BowProposal>(20, [&] {
    return BowProposal{random->Session(), SubmapId(random->Int(0, 99)), RandomKeyframe(random), random->Float(),
                       random->Float(),   random->Int(0, 1000)};
  });
  return answer;
}

FetchAnswer RandomFetchAnswer(RandomValues* random) {
  FetchAnswer answer;
  static_cast<Addressed&>(answer) = RandomAddress(random);
  answer.status = RandomStatus(FetchAnswer::Status::kBadRequest, random);
  answer.session = random->Session();
  answer.cumulative = random->Seq();
  answer.ended = random->Bool();
  int64_t seq = random->Int(0, 1000);
  answer.records = random->List<EncodedRecord>(9, [&] {
    return EncodedRecord{answer.session, seq += random->Int(1, 5), random->Text(), random->Bytes()};
  });
  answer.sessions = RandomCursors(random);
  return answer;
}

SessionProgress RandomProgress(RandomValues* random) {
  SessionProgress progress;
  static_cast<Addressed&>(progress) = RandomAddress(random);
  progress.status = RandomStatus(SessionProgress::Status::kUnknownSession, random);
  progress.session = random->Session();
  progress.cumulative = random->Seq();
  progress.ended = random->Bool();
  progress.next_submap = random->Int(0, 1 << 30);
  progress.next_keyframe = random->Int(0, 1 << 30);
  progress.next_point = random->Int(0, 1 << 30);
  progress.open_submap = SubmapId(random->Int(-1, 99));
  progress.last_frame = random->Int(-1, 1 << 30);
  progress.last_utime = random->Seq();
  return progress;
}

std::vector<EdgeDecision> RandomDecisions(RandomValues* random) {
  return random->List<EdgeDecision>(6, [&] { return EdgeDecision{random->Key(), random->Key(), random->Bool()}; });
}

TEST(QueryCodec, QuestionsComeBack) {
  RandomValues random(1);
  for (int i = 0; i < 300; ++i) {
    ExpectBack(RandomQuery(&random));
    ExpectBack(FetchRequest{RandomAddress(&random), random.Text(), random.Seq(), random.Seq(), random.Int(0, 1 << 30)});
    ExpectBack(ProgressRequest{RandomAddress(&random), random.Text()});
    ExpectBack(CloseRequest{RandomAddress(&random), random.Text()});
    ExpectBack(EdgeRequest{RandomAddress(&random), RandomDecisions(&random)});
    ExpectBack(RevisionRequest{RandomAddress(&random), random.Seq(), random.Int(-1, 99)});
  }
}

TEST(QueryCodec, AnswersComeBack) {
  RandomValues random(2);
  for (int i = 0; i < 300; ++i) {
    ExpectBack(RandomBowAnswer(&random));
    ExpectBack(RandomFetchAnswer(&random));
    ExpectBack(RandomProgress(&random));
    ExpectBack(CloseAnswer{RandomAddress(&random), RandomStatus(CloseAnswer::Status::kStillAlive, &random),
                           random.Session(), random.Seq()});
    ExpectBack(EdgeAnswer{RandomAddress(&random), RandomDecisions(&random)});
    ExpectBack(RevisionAnswer{RandomAddress(&random), RandomStatus(RevisionAnswer::Status::kNone, &random),
                              random.Seq(), random.Int(-1, 99), random.Int(0, 99), random.Bytes()});
    ExpectBack(RevisionAck{random.Seq(), random.Int(-1, 99)});
  }
}

// The layout of lcmtypes/bow_result_t.lcm, which other programs read.
TEST(QueryCodec, EveryFieldOfAnAnswerIsWhereItsMessageHasIt) {
  RandomValues random(3);
  BowAnswer answer = RandomBowAnswer(&random);
  answer.status = BowAnswer::Status::kNotYet;
  answer.proposals = {{"s", SubmapId(2), KeyframeId(7), 0.5f, 0.25f, 31}};
  bow_result_t message{};
  const auto data = Encode(answer);
  ASSERT_TRUE(DecodeMessage(data.data(), static_cast<int>(data.size()), &message));
  EXPECT_EQ(message.id, answer.id);
  EXPECT_EQ(message.requester, answer.requester);
  EXPECT_EQ(message.status, bow_result_t::NOT_YET);
  EXPECT_EQ(message.adjacent, answer.adjacent.value);
  EXPECT_EQ(message.nearby, answer.nearby.value);
  EXPECT_EQ(message.n1, answer.n1);
  EXPECT_EQ(message.s0, answer.s0);
  ASSERT_EQ(message.num_candidates, 1);
  EXPECT_EQ(message.candidates[0].keyframe, 7);
  EXPECT_EQ(message.candidates[0].group_score, 0.5f);
  EXPECT_EQ(message.candidates[0].score, 0.25f);
  EXPECT_EQ(message.candidates[0].common_words, 31);
}

template <typename Value, typename Message>
void ExpectUnknownStatusIsRefused() {
  for (const int8_t status : {-1, 9}) {
    Message message{};
    message.status = status;
    EXPECT_NE(Decode<Value>(EncodeMessage(message)).error, "") << Message::getTypeName();
    message.status = 0;
    EXPECT_EQ(Decode<Value>(EncodeMessage(message)).error, "") << Message::getTypeName();
  }
}

TEST(QueryCodec, RefusesAStatusThatDoesNotExist) {
  ExpectUnknownStatusIsRefused<BowAnswer, bow_result_t>();
  ExpectUnknownStatusIsRefused<FetchAnswer, fetched_t>();
  ExpectUnknownStatusIsRefused<SessionProgress, progress_t>();
  ExpectUnknownStatusIsRefused<CloseAnswer, session_closed_t>();
  ExpectUnknownStatusIsRefused<RevisionAnswer, revision_fetched_t>();
}

TEST(QueryCodec, RefusesRecordsWhoseLengthsDoNotFit) {
  const auto error_of = [](const std::vector<int64_t>& seq, const std::vector<int32_t>& size, int num_bytes) {
    fetched_t message{};
    message.num_records = static_cast<int32_t>(seq.size());
    message.seq = seq;
    message.size = size;
    message.channel.resize(seq.size());
    message.num_bytes = num_bytes;
    message.data.resize(static_cast<size_t>(num_bytes));
    return Decode<FetchAnswer>(EncodeMessage(message)).error;
  };
  EXPECT_EQ(error_of({4, 7}, {2, 3}, 5), "");
  EXPECT_NE(error_of({4, 7}, {2, 3}, 4), "");
  EXPECT_NE(error_of({4, 7}, {2, 3}, 6), "");
  EXPECT_NE(error_of({4, 7}, {6, -1}, 5), "");
  EXPECT_NE(error_of({4, 7}, {0x7fffffff, 0x7fffffff}, 5), "");
  EXPECT_NE(error_of({4, 4}, {2, 3}, 5), "");
  EXPECT_NE(error_of({7, 4}, {2, 3}, 5), "");
}

TEST(QueryCodec, TheErrorNamesTheMessage) {
  EXPECT_EQ(Decode<FetchAnswer>(std::vector<uint8_t>{1, 2, 3}).error, "not a fetched_t");
  EXPECT_EQ(Decode<BowAnswer>(Encode(FetchAnswer())).error, "not a bow_result_t");
}

}  // namespace query_codec_test
}  // namespace mapmend
