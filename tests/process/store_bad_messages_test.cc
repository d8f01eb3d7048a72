// Whoever reaches the hub can send anything: the store counts it, says so in its health, and serves honest flights as
// if nothing had come.

#include <gtest/gtest.h>

#include <cmath>
#include <limits>
#include <mapmend/bow_query_t.hpp>
#include <mapmend/fetch_t.hpp>
#include <mapmend/health_t.hpp>
#include <mapmend/keyframe_t.hpp>
#include <mapmend/map_update_t.hpp>
#include <mapmend/stream_state_t.hpp>
#include <random>

#include "libs/bus/bus.h"
#include "libs/bus/channels.h"
#include "libs/wire/codec.h"
#include "procs/submap_store/db_commands.h"
#include "tests/process/store_helper.h"
#include "tests/scratch_folder.h"

namespace mapmend {
namespace store_bad_messages_test {

// Sends bad messages and counts those that the store must count as bad.
class Vandal {
 public:
  Vandal(Bus* bus, const SyntheticStreamOptions& honest) : bus_(bus), records_(MakeSyntheticStream(honest)) {}

  void SendNoise(const std::string& channel) {
    for (int i = 0; i < 20; ++i) {
      std::vector<uint8_t> data(random_() % 200);
      for (uint8_t& byte : data) byte = static_cast<uint8_t>(random_());
      bus_->PublishRaw(channel, data.data(), static_cast<int>(data.size()));
      ++num_sent_;
    }
  }
  // A keyframe as only the first of an honest flight is right, under another session's name.
  template <typename Change>
  void SendKeyframe(const std::string& session, Change change) {
    const EncodedRecord encoded = EncodeRecord(records_[3]);
    keyframe_t message{};
    ASSERT_TRUE(DecodeMessage(encoded.data.data(), static_cast<int>(encoded.data.size()), &message));
    message.header.session = session;
    change(&message);
    bus_->Publish(channels::kKeyframe, message);
    ++num_sent_;
  }
  void SendHeartbeat(const std::string& session, int64_t first, int64_t last) {
    stream_state_t state{};
    state.session = session;
    state.first = first;
    state.last = last;
    bus_->Publish(channels::kStreamState, state);
    ++num_sent_;
  }
  int num_sent() const { return num_sent_; }

 private:
  Bus* bus_;
  std::vector<Record> records_;
  std::mt19937 random_{9};
  int num_sent_ = 0;
};

double Counter(const health_t& health, const std::string& name) {
  for (const counter_t& counter : health.counters) {
    if (counter.name == name) return counter.value;
  }
  return -1;
}

TEST(StoreBadMessages, AreCountedReportedAndHarmless) {
  const ScratchFolder folder;
  const std::string db = folder.File("map.db"), log = folder.File("log.txt");
  const int port = AnyFreePort();
  TestProcess hub = StartHub(port, log);
  TestProcess store = StartStore(db, port, log);
  Bus bus(HubUrl(port), "");
  health_t health{};
  const Subscription subscription =
      bus.Subscribe<health_t>(channels::kHealth, Delivery::kKeepAll, [&](const health_t& message) {
        if (message.process == "submap_store") health = message;
      });
  const auto hear = [&](const std::function<bool()>& done) {
    return PollUntil([&] { return bus.Handle(5), done(); }, 30000);
  };
  ASSERT_TRUE(hear([&] { return health.state == "ready"; }));

  SyntheticStreamOptions flight;
  flight.num_submaps = 2;
  flight.keyframes_per_submap = 40;
  SharedProgress* progress = MapSharedProgress();
  TestProcess frontend([&] { RunFrontend(flight, port, folder.File("outbox"), 5000, progress); });
  ASSERT_TRUE(hear([&] { return progress->acknowledged > 20; }));

  Vandal vandal(&bus, flight);
  for (const char* channel : kRecordChannels) vandal.SendNoise(channel);
  for (const char* channel : {channels::kStreamState, channels::kBowQuery, channels::kFetch, channels::kCloseSession,
                              channels::kRevision, channels::kRevisionPart, channels::kRevisionFetch}) {
    vandal.SendNoise(channel);
  }
  vandal.SendKeyframe("vandal", [](keyframe_t* m) { m->cam_from_submap[1] = std::nan(""); });
  vandal.SendKeyframe("vandal", [](keyframe_t* m) { m->keyframe = std::numeric_limits<int32_t>::max(); });
  vandal.SendKeyframe("vandal", [](keyframe_t* m) { m->bow_word.back() = std::numeric_limits<int32_t>::max(); });
  vandal.SendKeyframe("vandal", [](keyframe_t* m) { m->num_color_bytes = 0, m->colors.clear(), m->octave[0] = -3; });
  vandal.SendKeyframe("vandal", [](keyframe_t* m) {
    m->num_descriptor_bytes -= 32, m->descriptors.resize(m->descriptors.size() - 32);
  });
  vandal.SendKeyframe("../vandal", [](keyframe_t*) {});
  // The honest session jumps backwards: other content under numbers that are committed.
  for (int64_t seq = 0; seq < 15; ++seq) {
    vandal.SendKeyframe(flight.session, [seq](keyframe_t* m) { m->header.seq = seq, m->header.utime = 1; });
  }
  vandal.SendHeartbeat(flight.session, 0, std::numeric_limits<int64_t>::max());
  vandal.SendHeartbeat(flight.session, -7, 3);
  vandal.SendHeartbeat(flight.session, 900, 3);
  vandal.SendHeartbeat("no/session", 0, 3);
  EXPECT_TRUE(hear([&] { return Counter(health, "bad_messages") >= vandal.num_sent(); }))
      << Counter(health, "bad_messages") << " of " << vandal.num_sent();
  EXPECT_EQ(Counter(health, "bad_messages"), vandal.num_sent());
  EXPECT_EQ(health.state, "ready");

  EXPECT_EQ(frontend.Wait(60000), 0);
  EXPECT_EQ(store.Terminate(), 0);
  EXPECT_TRUE(CheckDb(db).empty());
  EXPECT_EQ(HashDb(db).stream, ExpectedStreamHash(flight, folder.File("expected.db")));
}

}  // namespace store_bad_messages_test
}  // namespace mapmend
