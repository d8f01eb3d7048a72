// What strangers and broken programs do to a hub, and that it goes on serving the others.

#include <gtest/gtest.h>
#include <ifaddrs.h>
#include <net/if.h>
#include <sys/resource.h>

#include <algorithm>
#include <chrono>
#include <ctime>
#include <fstream>
#include <memory>
#include <string>
#include <vector>

#include "libs/bus/hub.h"
#include "tests/unit/bus/raw_hub_client.h"

namespace mapmend {
namespace hub_attacks_test {

using Clock = std::chrono::steady_clock;

// The thread sanitizer keeps notes of memory, so many times its size.
#ifdef __SANITIZE_THREAD__
constexpr int64_t kNotes = 4;
#else
constexpr int64_t kNotes = 1;
#endif

double CpuSeconds() { return static_cast<double>(std::clock()) / CLOCKS_PER_SEC; }

int64_t ResidentBytes() {
  std::ifstream file("/proc/self/statm");
  int64_t total = 0, resident = 0;
  file >> total >> resident;
  return resident * sysconf(_SC_PAGESIZE);
}

// Whether a message gets through from one new client to another.
bool Serves(Hub* hub) {
  RawClient publisher(hub), subscriber(hub);
  publisher.Greet();
  subscriber.Greet();
  subscriber.Subscribe("MAPMEND_KEYFRAME");
  publisher.Publish("MAPMEND_KEYFRAME", "still here");
  return subscriber.Receive() == kGreeting + Message("MAPMEND_KEYFRAME", "still here");
}

TEST(HubAttacks, NoExpressionHoldsTheOthersUp) {
  Hub hub(OnAnyPort());
  RawClient publisher(&hub), subscriber(&hub);
  publisher.Greet();
  subscriber.Greet();
  subscriber.Subscribe("MAPMEND_KEYFRAME");
  subscriber.Receive();
  const double cpu_before = CpuSeconds();
  std::vector<std::string> expressions = {"(a*)*b",
                                          "(.*)*(.*)*(.*)*b",
                                          std::string(340, '(') + "a" + std::string(340, ')'),
                                          "(a|aa)+c",
                                          "((a{1,30}){1,30}){1,30}b",
                                          "(x+x+)+y",
                                          "((((.*)*)*)*)*z",
                                          std::string(300, '(') + "a*" + std::string(300, ')') + "*b",
                                          "(.*){1000}b",
                                          "(?=a)b",
                                          "(a)\\1",
                                          "[a-z]{1000}"};
  std::vector<std::unique_ptr<RawClient>> attackers;
  for (const std::string& expression : expressions) {
    attackers.push_back(std::make_unique<RawClient>(&hub));
    attackers.back()->Greet();
    attackers.back()->Subscribe(expression);
  }
  for (int i = 0; i < 50; ++i) {
    publisher.Publish(std::string(60, 'a') + std::to_string(i), "bait");
    publisher.Publish("MAPMEND_KEYFRAME", std::to_string(i));
    EXPECT_EQ(subscriber.Receive(), Message("MAPMEND_KEYFRAME", std::to_string(i)));
  }
  EXPECT_LT(CpuSeconds() - cpu_before, 2.0);
  // What no linear matcher can do only costs its own connection.
  EXPECT_TRUE(attackers[9]->IsClosed() || !attackers[9]->Receive().empty());
  EXPECT_TRUE(Serves(&hub));
}

TEST(HubAttacks, AnExpressionHasToMatchTheWholeName) {
  Hub hub(OnAnyPort());
  RawClient publisher(&hub), subscriber(&hub);
  publisher.Greet();
  subscriber.Greet();
  subscriber.Subscribe("A|B[0-9]+");
  for (const char* channel : {"A", "AB", "B", "B12", "B12x", "xA"}) publisher.Publish(channel, "");
  EXPECT_EQ(subscriber.Receive(), kGreeting + Message("A", "") + Message("B12", ""));
}

std::string Subscription(const std::string& pattern) { return RawClient::U32(2) + RawClient::Text(pattern); }
std::string Cancellation(const std::string& pattern) { return RawClient::U32(3) + RawClient::Text(pattern); }

TEST(HubAttacks, SubscriptionsOfAClientAreBounded) {
  Hub hub(OnAnyPort());
  RawClient names(&hub), expressions(&hub);
  names.Greet();
  std::string many;
  for (int i = 0; i < 256; ++i) many += Subscription(std::string("CHANNEL") + std::to_string(i));
  names.SendRaw(many);
  names.Receive();
  EXPECT_FALSE(names.IsClosed());
  names.Subscribe("ONE_MORE");
  EXPECT_TRUE(names.IsClosed());
  expressions.Greet();
  many.clear();
  for (int i = 0; i < 40; ++i) many += Subscription(std::string("C.*") + std::to_string(i));
  expressions.SendRaw(many);
  expressions.Receive();
  EXPECT_TRUE(expressions.IsClosed());
  EXPECT_TRUE(Serves(&hub));
}

TEST(HubAttacks, EqualSubscriptionsAreTakenBackOneByOne) {
  Hub hub(OnAnyPort());
  RawClient client(&hub);
  client.Greet();
  client.Receive();
  const std::string all_but_one =
      Subscription("A") + Subscription("A") + Subscription("A.*") + Cancellation("A") + Cancellation("A.*");
  client.SendRaw(all_but_one);
  client.Publish("A", "1");
  EXPECT_EQ(client.Receive(), Message("A", "1"));
  client.SendRaw(Cancellation("A"));
  client.Publish("A", "2");
  EXPECT_EQ(client.Receive(), "");
  // What was taken back does not count against the bound.
  std::string many;
  for (int round = 0; round < 400; ++round) many += all_but_one + Cancellation("A");
  client.SendRaw(many);
  client.Publish("A", "3");
  EXPECT_EQ(client.Receive(), "");
  EXPECT_FALSE(client.IsClosed());
}

TEST(HubAttacks, IdleConnectionsKeepNobodyOutAndCostNothing) {
  HubOptions options = OnAnyPort();
  options.greeting_timeout_ms = 1000;
  Hub hub(options);
  rlimit limit{};
  if (getrlimit(RLIMIT_NOFILE, &limit) != 0 || limit.rlim_cur < 2000) GTEST_SKIP() << "too few descriptors";
  std::vector<std::unique_ptr<RawClient>> idle;
  for (int i = 0; i < 1082; ++i) {
    idle.push_back(std::make_unique<RawClient>(&hub));
    hub.Spin(0);
  }
  EXPECT_TRUE(Serves(&hub));
  EXPECT_LE(hub.GetStatistics().num_clients, 256);
  const double cpu_before = CpuSeconds();
  const auto start = Clock::now();
  while (Clock::now() - start < std::chrono::milliseconds(1800)) hub.Spin(200);
  EXPECT_LT(CpuSeconds() - cpu_before, 0.3);
  EXPECT_EQ(hub.GetStatistics().num_clients, 0) << "nobody has greeted";
  idle.front()->Receive();
  EXPECT_TRUE(idle.front()->IsClosed());
}

TEST(HubAttacks, WithoutDescriptorsNewcomersAreTurnedAwayWithoutSpinning) {
  HubOptions options = OnAnyPort();
  Hub hub(options);
  rlimit before{};
  getrlimit(RLIMIT_NOFILE, &before);
  std::vector<std::unique_ptr<RawClient>> clients;
  for (int i = 0; i < 10; ++i) {
    clients.push_back(std::make_unique<RawClient>(&hub));
    clients.back()->Greet();
  }
  // The hub can have no more than it has, while others may still knock.
  const int knocking = socket(AF_INET, SOCK_STREAM, 0);
  const int highest = dup(knocking);
  close(highest);
  rlimit none = before;
  none.rlim_cur = static_cast<rlim_t>(highest);
  ASSERT_EQ(setrlimit(RLIMIT_NOFILE, &none), 0);
  sockaddr_in address{};
  address.sin_family = AF_INET;
  address.sin_port = htons(static_cast<uint16_t>(hub.Port()));
  address.sin_addr.s_addr = htonl(INADDR_LOOPBACK);
  EXPECT_EQ(connect(knocking, reinterpret_cast<sockaddr*>(&address), sizeof(address)), 0);
  const double cpu_before = CpuSeconds();
  const auto start = Clock::now();
  while (Clock::now() - start < std::chrono::milliseconds(1000)) hub.Spin(200);
  EXPECT_LT(CpuSeconds() - cpu_before, 0.3);
  EXPECT_EQ(hub.GetStatistics().num_turned_away, 1);
  setrlimit(RLIMIT_NOFILE, &before);
  close(knocking);
  EXPECT_TRUE(Serves(&hub));
}

TEST(HubAttacks, AFullHubKeepsThoseItServes) {
  HubOptions options = OnAnyPort();
  options.max_clients = 8;
  Hub hub(options);
  std::vector<std::unique_ptr<RawClient>> clients;
  for (int i = 0; i < 8; ++i) {
    clients.push_back(std::make_unique<RawClient>(&hub));
    clients.back()->Greet();
    clients.back()->Subscribe("A");
    EXPECT_EQ(clients.back()->Receive(), kGreeting);
  }
  RawClient late(&hub);
  EXPECT_TRUE(late.IsClosed());
  for (const auto& client : clients) EXPECT_FALSE(client->IsClosed());
  clients.pop_back();
  RawClient next(&hub);
  next.Greet();
  EXPECT_EQ(next.Receive(), kGreeting);
}

TEST(HubAttacks, WhoGreetsAndDoesNothingMakesRoom) {
  HubOptions options = OnAnyPort();
  options.max_clients = 16;
  Hub hub(options);
  RawClient served(&hub);
  served.Greet();
  served.Subscribe("A");
  std::vector<std::unique_ptr<RawClient>> idle;
  for (int i = 0; i < 100; ++i) {
    idle.push_back(std::make_unique<RawClient>(&hub));
    idle.back()->SendRaw(RawClient::U32(0x287617fb) + RawClient::U32(0x0100));
  }
  EXPECT_TRUE(Serves(&hub));
  EXPECT_FALSE(served.IsClosed());
}

TEST(HubAttacks, AnnouncedBytesTakeNoMemoryAndHeldOnesAreBounded) {
  HubOptions options = OnAnyPort();
  options.max_buffered_bytes = 32 << 20;
  Hub hub(options);
  std::vector<std::unique_ptr<RawClient>> clients;
  const int64_t before = ResidentBytes();
  for (int i = 0; i < 40; ++i) {
    clients.push_back(std::make_unique<RawClient>(&hub));
    clients.back()->Greet();
    clients.back()->SendRaw(RawClient::U32(1) + RawClient::Text("A") + RawClient::U32(64 << 20) + "begun");
  }
  EXPECT_LT(hub.GetStatistics().buffered_bytes, 1 << 20);
  EXPECT_EQ(hub.GetStatistics().num_clients, 40);
  const std::string part(5 << 20, 'x');
  for (const auto& client : clients) client->SendRaw(part);
  EXPECT_LE(hub.GetStatistics().buffered_bytes, 33 << 20);
  EXPECT_GT(hub.GetStatistics().num_refused_clients, 30);
  EXPECT_LT(ResidentBytes() - before, kNotes * (64 << 20));
  EXPECT_TRUE(Serves(&hub));
  clients.clear();
  for (int i = 0; i < 5; ++i) hub.Spin(1);
  EXPECT_EQ(hub.GetStatistics().buffered_bytes, 0);
}

TEST(HubAttacks, SubscribersThatNeverReadAreBoundedTogether) {
  HubOptions options = OnAnyPort();
  options.max_buffered_bytes = 24 << 20;
  options.reliable_queue_bytes = 8 << 20;
  options.backpressure_timeout_ms = 50;
  Hub hub(options);
  RawClient publisher(&hub);
  publisher.Greet();
  std::vector<std::unique_ptr<RawClient>> stopped;
  const std::string body(200000, 'x');
  for (int i = 0; i < 6; ++i) {
    stopped.push_back(std::make_unique<RawClient>(&hub, 4096));
    stopped.back()->Greet();
    stopped.back()->Subscribe(std::string("C") + std::to_string(i));
    for (int k = 0; k < 80; ++k) publisher.Publish(std::string("C") + std::to_string(i), body);
  }
  EXPECT_LE(hub.GetStatistics().buffered_bytes, 25 << 20);
  EXPECT_GE(hub.GetStatistics().num_refused_clients, 2);
  EXPECT_TRUE(Serves(&hub));
}

TEST(HubAttacks, EmptyMessagesCountToo) {
  HubOptions options = OnAnyPort();
  options.reliable_queue_bytes = 1 << 20;
  options.backpressure_timeout_ms = 100;
  Hub hub(options);
  RawClient publisher(&hub), stopped(&hub, 2048);
  publisher.Greet();
  stopped.Greet();
  stopped.Subscribe("A");
  std::string many;
  for (int i = 0; i < 1000; ++i) many += Message("A", "");
  for (int i = 0; i < 300; ++i) publisher.SendRaw(many);
  EXPECT_LT(hub.GetStatistics().buffered_bytes, 2 << 20);
}

// A subscriber that reads just enough to be waited for again and again would stop the flight for ever.
TEST(HubAttacks, NobodyWaitsTwiceForTheSameSubscriber) {
  HubOptions options = OnAnyPort();
  options.reliable_queue_bytes = 1 << 20;
  options.backpressure_timeout_ms = 3000;
  Hub hub(options);
  RawClient publisher(&hub), tease(&hub, 4096);
  publisher.Greet();
  tease.Greet();
  tease.Subscribe("MAPMEND_KEYFRAME");
  const std::string body(100000, 'x');
  std::vector<char> buffer(1 << 20);
  std::vector<Clock::duration> waited;
  for (int round = 0; round < 4; ++round) {
    const auto start = Clock::now();
    for (int i = 0; i < 120; ++i) publisher.SendRaw(Message("MAPMEND_KEYFRAME", body));
    waited.push_back(Clock::now() - start);
    // Reads all that waits, so that it counts again.
    for (int idle = 0; idle < 20;) {
      idle = recv(tease.fd(), buffer.data(), buffer.size(), MSG_DONTWAIT) > 0 ? 0 : idle + 1;
      hub.Spin(idle > 0 ? 1 : 0);
    }
  }
  EXPECT_GE(waited[0], std::chrono::milliseconds(3000));
  const auto later = *std::min_element(waited.begin() + 1, waited.end());
  EXPECT_LT(later, waited[0] - std::chrono::milliseconds(1500));
  EXPECT_GT(hub.GetStatistics().num_dropped_reliable, 100);
}

// The kernel's own time-out for dead peers would end it.
TEST(HubAttacks, WhoOnlyIsSlowToReadIsNotTakenForDead) {
  Hub hub(OnAnyPort());
  RawClient publisher(&hub), slow(&hub, 4096);
  publisher.Greet();
  slow.Greet();
  slow.Subscribe("A");
  const std::string body(100000, 'x');
  for (int i = 0; i < 100; ++i) publisher.SendRaw(Message("A", body));
  const auto start = Clock::now();
  while (Clock::now() - start < std::chrono::seconds(8)) hub.Spin(200);
  EXPECT_EQ(hub.GetStatistics().num_dead_clients, 0);
  size_t received = 0;
  std::vector<char> buffer(1 << 20);
  const auto give_up = Clock::now() + std::chrono::seconds(60);
  while (received < 100 * body.size() && Clock::now() < give_up) {
    const ssize_t n = recv(slow.fd(), buffer.data(), buffer.size(), MSG_DONTWAIT);
    if (n > 0) received += static_cast<size_t>(n);
    hub.Spin(n > 0 ? 0 : 1);
  }
  EXPECT_GT(received, 100 * body.size());
}

// One that floods gets its turn and no more.
TEST(HubAttacks, AFloodOfSmallMessagesLeavesTurnsForOthers) {
  Hub hub(OnAnyPort());
  RawClient flood(&hub), publisher(&hub), subscriber(&hub);
  flood.Greet();
  publisher.Greet();
  subscriber.Greet();
  subscriber.Subscribe("MAPMEND_KEYFRAME");
  std::vector<std::unique_ptr<RawClient>> listeners;
  for (int i = 0; i < 30; ++i) {
    listeners.push_back(std::make_unique<RawClient>(&hub));
    listeners.back()->Greet();
    for (int k = 0; k < 8; ++k)
      listeners.back()->Subscribe(std::string("(a|b|c)*") + std::to_string(i * 8 + k) + "(x*y*)*");
  }
  subscriber.Receive();
  std::string names;
  for (int i = 0; i < 4000; ++i) names += Message(std::string("abcabc") + std::to_string(i) + std::string(40, 'x'), "");
  const int fd = flood.fd();
  send(fd, names.data(), names.size(), MSG_DONTWAIT);
  const std::string message = Message("MAPMEND_KEYFRAME", "now");
  send(publisher.fd(), message.data(), message.size(), MSG_DONTWAIT);
  const double cpu_before = CpuSeconds();
  const auto start = Clock::now();
  std::string received;
  char buffer[4096];
  while (received.empty() && Clock::now() - start < std::chrono::seconds(20)) {
    hub.Spin(0);
    const ssize_t n = recv(subscriber.fd(), buffer, sizeof(buffer), MSG_DONTWAIT);
    if (n > 0) received.assign(buffer, static_cast<size_t>(n));
  }
  EXPECT_EQ(received, message);
  EXPECT_LT(CpuSeconds() - cpu_before, 0.3);
}

// An address of this host that is not loopback stands for another host; 0 if there is none.
uint32_t OtherAddress() {
  ifaddrs* all = nullptr;
  if (getifaddrs(&all) != 0) return 0;
  uint32_t found = 0;
  for (const ifaddrs* one = all; one != nullptr && found == 0; one = one->ifa_next) {
    if (one->ifa_addr == nullptr || one->ifa_addr->sa_family != AF_INET || (one->ifa_flags & IFF_UP) == 0) continue;
    const uint32_t address = ntohl(reinterpret_cast<const sockaddr_in*>(one->ifa_addr)->sin_addr.s_addr);
    if (address >> 24 != 127) found = address;
  }
  freeifaddrs(all);
  return found;
}

class HubFromElsewhere : public ::testing::Test {
 protected:
  void SetUp() override {
    if (OtherAddress() == 0) GTEST_SKIP() << "this host has loopback addresses only";
    HubOptions options = OnAnyPort();
    options.bind = "0.0.0.0";
    options.token = kToken;
    options.max_clients = 16;
    hub_ = std::make_unique<Hub>(options);
    remote_ = std::make_unique<RawClient>(hub_.get(), 0, OtherAddress());
    local_ = std::make_unique<RawClient>(hub_.get());
    for (RawClient* client : {remote_.get(), local_.get()}) {
      client->Greet();
      client->Subscribe(".*");
      client->Receive();
    }
  }
  static constexpr char kToken[] = "0123456789abcdef0123456789abcdef";
  std::unique_ptr<Hub> hub_;
  std::unique_ptr<RawClient> remote_, local_;
};

TEST_F(HubFromElsewhere, WithoutTokenOneMayListenButNotSpeak) {
  local_->Publish("A", "for all");
  EXPECT_EQ(remote_->Receive(), Message("A", "for all"));
  EXPECT_EQ(local_->Receive(), Message("A", "for all"));
  remote_->Publish("MAPMEND_KEYFRAME", "forged");
  EXPECT_EQ(local_->Receive(), "");
  EXPECT_EQ(hub_->GetStatistics().num_dropped_unauthorised, 1);
}

TEST_F(HubFromElsewhere, TheTokenOpensAndIsNeverPassedOn) {
  remote_->Publish("MAPMEND_TOKEN", kToken);
  remote_->Publish("MAPMEND_KEYFRAME", "true");
  EXPECT_EQ(local_->Receive(), Message("MAPMEND_KEYFRAME", "true"));
  local_->Publish("MAPMEND_TOKEN", kToken);
  local_->Publish("R1_MAPMEND_TOKEN", kToken);
  EXPECT_EQ(remote_->Receive(), Message("MAPMEND_KEYFRAME", "true"));
}

TEST_F(HubFromElsewhere, AWrongTokenClosesAgainAndThreeEndTheConnection) {
  remote_->Publish("MAPMEND_TOKEN", kToken);
  remote_->Publish("MAPMEND_TOKEN", std::string(kToken) + "0");
  remote_->Publish("A", "1");
  EXPECT_EQ(local_->Receive(), "");
  EXPECT_FALSE(remote_->IsClosed());
  remote_->Publish("MAPMEND_TOKEN", "");
  remote_->Publish("MAPMEND_TOKEN", "0123456789abcdef0123456789abcdee");
  EXPECT_TRUE(remote_->IsClosed());
}

TEST_F(HubFromElsewhere, APingComesBackToItsSenderOnly) {
  remote_->Publish("MAPMEND_PING_77", "x");
  EXPECT_EQ(remote_->Receive(), Message("MAPMEND_PING_77", "x"));
  EXPECT_EQ(local_->Receive(), "");
}

TEST_F(HubFromElsewhere, OtherHostsCannotTakeAllPlaces) {
  std::vector<std::unique_ptr<RawClient>> crowd;
  for (int i = 0; i < 40; ++i) {
    crowd.push_back(std::make_unique<RawClient>(hub_.get(), 0, OtherAddress()));
    crowd.back()->Greet();
  }
  EXPECT_LE(hub_->GetStatistics().num_clients, 13);
  EXPECT_TRUE(Serves(hub_.get()));
}

TEST(HubOptions, OtherHostsNeedAToken) {
  HubOptions options = OnAnyPort();
  options.bind = "0.0.0.0";
  EXPECT_NE(options.Check().find("--token-file"), std::string::npos);
  options.token = "0123456789abcdef";
  EXPECT_EQ(options.Check(), "");
}

}  // namespace hub_attacks_test
}  // namespace mapmend
