#include "libs/bus/bus.h"

#include <gtest/gtest.h>

#include <chrono>
#include <mapmend/ack_t.hpp>
#include <mapmend/fetched_t.hpp>
#include <thread>

#include "tests/running_hub.h"

namespace mapmend {
namespace bus_test {

ack_t MakeAck(int64_t cumulative) {
  ack_t ack{};
  ack.session = "s";
  ack.cumulative = cumulative;
  return ack;
}

bool HandleUntil(Bus* bus, const std::function<bool()>& done, int timeout_ms = 5000) {
  const auto deadline = std::chrono::steady_clock::now() + std::chrono::milliseconds(timeout_ms);
  while (!done() && std::chrono::steady_clock::now() < deadline) bus->Handle(10);
  return done();
}

TEST(ResolveLcmUrl, PrefersArgumentThenEnvironmentThenLocalHub) {
  setenv("LCM_DEFAULT_URL", "udpm://239.255.76.67:7667?ttl=0", 1);
  EXPECT_EQ(ResolveLcmUrl("memq://"), "memq://");
  EXPECT_EQ(ResolveLcmUrl(""), "udpm://239.255.76.67:7667?ttl=0");
  unsetenv("LCM_DEFAULT_URL");
  EXPECT_EQ(ResolveLcmUrl(""), "tcpq://127.0.0.1:7700");
}

TEST(Bus, RefusesMalformedUrlAndPrefix) {
  EXPECT_THROW(Bus("carrier-pigeon://x", ""), std::runtime_error);
  EXPECT_THROW(Bus("7700", ""), std::runtime_error);
  EXPECT_THROW(Bus("memq://", "a.*"), std::runtime_error);
}

TEST(Bus, PrefixSeparatesRunsOnOneHub) {
  RunningHub hub;
  Bus a(hub.Url(), "A_"), b(hub.Url(), "B_");
  int64_t heard_a = -1, heard_b = -1;
  const Subscription of_a =
      a.Subscribe<ack_t>("X", Delivery::kKeepAll, [&](const ack_t& ack) { heard_a = ack.cumulative; });
  const Subscription of_b =
      b.Subscribe<ack_t>("X", Delivery::kKeepAll, [&](const ack_t& ack) { heard_b = ack.cumulative; });
  EXPECT_TRUE(HandleUntil(&a, [&] { return a.Publish("X", MakeAck(7)) && heard_a == 7; }));
  b.Handle(50);
  EXPECT_EQ(heard_b, -1);
}

TEST(Bus, ConcurrentPublishersLoseNothing) {
  RunningHub hub;
  Bus bus(hub.Url(), ""), listener(hub.Url(), "");
  std::vector<int> heard(3, 0);
  bool in_order = true, is_subscribed = false;
  const Subscription of_listener = listener.Subscribe<ack_t>("X", Delivery::kKeepAll, [&](const ack_t& ack) {
    int& count = heard[static_cast<size_t>(ack.cumulative / 1000)];
    in_order = in_order && ack.cumulative % 1000 == count;
    ++count;
  });
  const Subscription of_ready =
      listener.Subscribe<ack_t>("READY", Delivery::kKeepAll, [&](const ack_t&) { is_subscribed = true; });
  ASSERT_TRUE(HandleUntil(&listener, [&] {
    listener.Publish("READY", MakeAck(0));
    return is_subscribed;
  }));
  std::vector<std::thread> threads;
  for (int t = 0; t < 3; ++t) {
    threads.emplace_back([&bus, t] {
      for (int i = 0; i < 200; ++i) bus.Publish("X", MakeAck(1000 * t + i));
    });
  }
  EXPECT_TRUE(HandleUntil(&listener, [&] { return heard == std::vector<int>(3, 200); }));
  EXPECT_TRUE(in_order);
  for (std::thread& thread : threads) thread.join();
}

TEST(Bus, ReconnectsAndSubscribesAgainAfterTheHubRestarted) {
  auto hub = std::make_unique<RunningHub>();
  const int port = hub->Port();
  Bus bus(hub->Url(), ""), other(hub->Url(), "");
  int64_t heard = -1;
  const Subscription of_bus =
      bus.Subscribe<ack_t>("X", Delivery::kKeepAll, [&](const ack_t& ack) { heard = ack.cumulative; });
  // Again and again: the hub may learn of the subscription after it has a first message.
  ASSERT_TRUE(HandleUntil(&bus, [&] {
    other.Publish("X", MakeAck(1));
    return heard == 1;
  }));
  hub.reset();
  EXPECT_TRUE(HandleUntil(&bus, [&] { return !bus.IsConnected(); }));
  while (bus.Handle(0) > 0) continue;  // what came before the hub went
  EXPECT_EQ(bus.Handle(30), 0);        // returns in spite of the hub's absence
  hub = std::make_unique<RunningHub>(HubOptions{}, port);
  ASSERT_TRUE(HandleUntil(&bus, [&] { return bus.IsConnected(); }));
  EXPECT_TRUE(HandleUntil(&bus, [&] {
    other.Publish("X", MakeAck(2));
    return heard == 2;
  }));
}

TEST(Bus, StartsBeforeTheHubDoes) {
  int port = 0;
  { port = RunningHub().Port(); }
  Bus bus("tcpq://127.0.0.1:" + std::to_string(port), "");
  EXPECT_FALSE(bus.IsConnected());
  EXPECT_FALSE(bus.Publish("X", MakeAck(1)));
  int64_t heard = -1;
  const Subscription of_bus =
      bus.Subscribe<ack_t>("X", Delivery::kKeepAll, [&](const ack_t& ack) { heard = ack.cumulative; });
  RunningHub hub({}, port);
  EXPECT_TRUE(HandleUntil(&bus, [&] {
    bus.Publish("X", MakeAck(3));
    return heard == 3;
  }));
}

TEST(Bus, AHandlerIsNotCalledOnceItsSubscriptionHasEnded) {
  RunningHub hub;
  for (const std::string& url : {std::string("memq://"), hub.Url()}) {
    Bus bus(url, "");
    int num_first = 0, num_second = 0;
    auto first = std::make_unique<Subscription>(
        bus.Subscribe<ack_t>("X", Delivery::kKeepAll, [&](const ack_t&) { ++num_first; }));
    Subscription second = bus.Subscribe<ack_t>("X", Delivery::kKeepAll, [&](const ack_t&) {
      if (++num_second == 2) second.Reset();  // from within
    });
    bus.Publish("X", MakeAck(1));
    ASSERT_TRUE(HandleUntil(&bus, [&] { return num_first == 1 && num_second == 1; })) << url;
    bus.Publish("X", MakeAck(2));  // may be in the queue already
    first.reset();
    for (int i = 0; i < 3; ++i) bus.Publish("X", MakeAck(3));
    ASSERT_TRUE(HandleUntil(&bus, [&] { return num_second == 2; })) << url;
    HandleUntil(
        &bus, [] { return false; }, 100);
    EXPECT_EQ(num_first, 1) << url;
    EXPECT_EQ(num_second, 2) << url;
  }
}

TEST(Bus, ASubscriptionMayOutliveTheBus) {
  Subscription subscription;
  {
    Bus bus("memq://", "");
    subscription = bus.Subscribe<ack_t>("X", Delivery::kKeepAll, [](const ack_t&) {});
  }
  subscription.Reset();
}

TEST(Bus, CountsAndDropsWhatDoesNotDecode) {
  Bus bus("memq://", "");
  int num_heard = 0;
  const Subscription of_bus = bus.Subscribe<ack_t>("X", Delivery::kKeepAll, [&](const ack_t&) { ++num_heard; });
  const uint8_t garbage[3] = {1, 2, 3};
  bus.PublishRaw("X", garbage, 3);
  std::vector<uint8_t> trailing = EncodeMessage(MakeAck(1));
  trailing.push_back(0);
  bus.PublishRaw("X", trailing.data(), static_cast<int>(trailing.size()));
  bus.Publish("X", MakeAck(1));
  EXPECT_TRUE(HandleUntil(&bus, [&] { return num_heard == 1 && bus.NumRefused() == 2; }));
}

TEST(Bus, SurvivesHandlersThatThrow) {
  Bus bus("memq://", "");
  int num_heard = 0;
  const Subscription of_bus = bus.Subscribe<ack_t>("X", Delivery::kKeepAll, [&](const ack_t& ack) {
    ++num_heard;
    if (ack.cumulative == 1) throw std::runtime_error("handler failed");
  });
  bus.Publish("X", MakeAck(1));
  bus.Publish("X", MakeAck(2));
  EXPECT_TRUE(HandleUntil(&bus, [&] { return num_heard == 2; }));
  EXPECT_EQ(bus.NumRefused(), 1);
}

TEST(DecodeMessage, RefusesForgedArrayLengthsWithoutAllocating) {
  fetched_t message{};
  message.num_records = 1;
  message.seq = {5};
  message.channel = {"C"};
  message.size = {0};
  std::vector<uint8_t> data = EncodeMessage(message);
  // id, requester "", status, session "", cumulative, ended precede num_records.
  const size_t at = 8 + 8 + 5 + 1 + 5 + 8 + 1;
  ASSERT_EQ(data[at + 3], 1);
  for (const uint8_t top : {0x7f, 0xff, 0x10}) {
    std::vector<uint8_t> forged = data;
    forged[at] = top;
    fetched_t decoded{};
    EXPECT_FALSE(DecodeMessage(forged.data(), static_cast<int>(forged.size()), &decoded));
    EXPECT_LE(decoded.seq.capacity(), forged.size());
  }
}

}  // namespace bus_test
}  // namespace mapmend
