#include "libs/bus/hub.h"

#include <gtest/gtest.h>

#include <chrono>
#include <string>
#include <vector>

#include "tests/unit/bus/raw_hub_client.h"

namespace mapmend {
namespace hub_test {

TEST(Hub, SpeaksTheProtocolOfLcmsTcpService) {
  Hub hub(OnAnyPort());
  RawClient publisher(&hub), subscriber(&hub);
  publisher.Greet();
  subscriber.Greet();
  EXPECT_EQ(subscriber.Receive(), kGreeting);
  subscriber.Subscribe("A");
  subscriber.Subscribe("B.*");
  publisher.Publish("A", "one");
  publisher.Publish("AA", "not wanted");
  publisher.Publish("BEE", "two");
  EXPECT_EQ(subscriber.Receive(), Message("A", "one") + Message("BEE", "two"));
  EXPECT_EQ(publisher.Receive(), kGreeting);
  subscriber.Unsubscribe("A");
  publisher.Publish("A", "three");
  publisher.Publish("B", "");
  EXPECT_EQ(subscriber.Receive(), Message("B", ""));
}

TEST(Hub, AnswersMessagesThatComeInPieces) {
  Hub hub(OnAnyPort());
  RawClient client(&hub);
  const std::string bytes = RawClient::U32(0x287617fb) + RawClient::U32(0x0100) + RawClient::U32(2) +
                            RawClient::Text("X") + Message("X", "payload");
  for (const char c : bytes) client.SendRaw(std::string(1, c));
  EXPECT_EQ(client.Receive(), kGreeting + Message("X", "payload"));
}

TEST(Hub, DisconnectsWhoDoesNotSpeakTheProtocol) {
  HubOptions options = OnAnyPort();
  options.max_message_bytes = 1000;
  Hub hub(options);
  RawClient browser(&hub), forger(&hub), pattern(&hub), large(&hub), fine(&hub);
  browser.SendRaw("GET / HTTP/1.1\r\n\r\n");
  forger.Greet();
  forger.SendRaw(RawClient::U32(1) + RawClient::U32(0x7fffffff));
  pattern.Greet();
  pattern.Subscribe("([");
  large.Greet();
  large.SendRaw(RawClient::U32(1) + RawClient::Text("A") + RawClient::U32(1001));
  fine.Greet();
  browser.Receive();
  forger.Receive();
  pattern.Receive();
  large.Receive();
  EXPECT_TRUE(browser.IsClosed());
  EXPECT_TRUE(forger.IsClosed());
  EXPECT_TRUE(pattern.IsClosed());
  EXPECT_TRUE(large.IsClosed());
  EXPECT_EQ(hub.GetStatistics().num_clients, 1);
  EXPECT_EQ(hub.GetStatistics().num_refused_clients, 4);
}

TEST(Hub, KeepsTheNewestOfBestEffortChannelsForASlowSubscriber) {
  HubOptions options = OnAnyPort();
  options.best_effort_queue_bytes = 1 << 20;
  Hub hub(options);
  RawClient publisher(&hub), slow(&hub, 4096);
  publisher.Greet();
  slow.Greet();
  slow.Subscribe(".*MAPMEND_IMAGE");
  const std::string body(100000, 'x');
  for (int i = 0; i < 100; ++i) publisher.Publish("R1_MAPMEND_IMAGE", std::to_string(1000 + i) + body);
  EXPECT_TRUE(publisher.all_sent());  // it never waited
  EXPECT_GT(hub.GetStatistics().num_dropped, 30);
  EXPECT_LE(hub.GetStatistics().queued_bytes, (1 << 20) + 2 * 100050);
  std::string received;
  for (int i = 0; i < 2000 && received.find("1099x") == std::string::npos; ++i) received += slow.Receive();
  EXPECT_NE(received.find("1099x"), std::string::npos);  // the newest
  EXPECT_EQ(received.find("1050x"), std::string::npos);  // long replaced
}

TEST(Hub, PublishersOfTheStreamWaitForAFullSubscriberUntilItIsGivenUp) {
  HubOptions options = OnAnyPort();
  options.reliable_queue_bytes = 1 << 20;
  options.backpressure_timeout_ms = 300;
  Hub hub(options);
  RawClient publisher(&hub), stopped(&hub, 4096), live(&hub);
  publisher.Greet();
  stopped.Greet();
  live.Greet();
  stopped.Subscribe("MAPMEND_KEYFRAME");
  live.Subscribe("MAPMEND_KEYFRAME");
  const std::string body(100000, 'x');
  const auto start = std::chrono::steady_clock::now();
  std::string received;
  for (int i = 0; i < 200; ++i) {
    publisher.Publish("MAPMEND_KEYFRAME", std::to_string(1000 + i) + body);
    received += live.Receive();
  }
  for (int i = 0; i < 1000 && received.size() < 200 * 100000; ++i) received += live.Receive();
  const auto waited = std::chrono::steady_clock::now() - start;
  EXPECT_GE(waited, std::chrono::milliseconds(300));
  EXPECT_LT(waited, std::chrono::seconds(30));  // it takes 57 if every message waits
  EXPECT_GT(hub.GetStatistics().num_dropped_reliable, 50);
  // The one that reads got everything.
  for (int i = 0; i < 200; ++i) EXPECT_NE(received.find(std::to_string(1000 + i) + "x"), std::string::npos) << i;
  EXPECT_LT(hub.GetStatistics().queued_bytes, 20 << 20);
}

TEST(Hub, SaysThatThePortIsInUse) {
  Hub hub(OnAnyPort());
  HubOptions options;
  options.port = hub.Port();
  EXPECT_THROW(Hub{options}, std::runtime_error);
  options.bind = "not an address";
  EXPECT_THROW(Hub{options}, std::runtime_error);
}

}  // namespace hub_test
}  // namespace mapmend
