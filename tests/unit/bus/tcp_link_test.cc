#include "libs/bus/tcp_link.h"

#include <gtest/gtest.h>
#include <sys/resource.h>

#include <chrono>
#include <functional>
#include <numeric>

#include "tests/running_hub.h"
#include "tests/tcp_proxy.h"

namespace mapmend {
namespace tcp_link_test {

using Clock = std::chrono::steady_clock;

double SecondsSince(Clock::time_point begin) { return std::chrono::duration<double>(Clock::now() - begin).count(); }

double CpuSeconds() {
  rusage usage{};
  getrusage(RUSAGE_SELF, &usage);
  const auto seconds = [](const timeval& t) {
    return static_cast<double>(t.tv_sec) + 1e-6 * static_cast<double>(t.tv_usec);
  };
  return seconds(usage.ru_utime) + seconds(usage.ru_stime);
}

TcpLinkOptions LinkTo(int port) {
  TcpLinkOptions options;
  options.port = port;
  return options;
}

// The numbers that come over one channel.
class Listener {
 public:
  Listener(std::shared_ptr<TcpLink> link, const std::string& channel, Delivery delivery = Delivery::kKeepAll)
      : link_(std::move(link)) {
    auto subscriber = std::make_shared<Subscriber>(
        channel, delivery, [this](const uint8_t* data, int) { heard.push_back(data[0]); }, [](const std::string&) {});
    link_->Add(subscriber);
    subscription_ = Subscription(subscriber, link_);
  }
  std::vector<int> heard;

 private:
  std::shared_ptr<TcpLink> link_;
  Subscription subscription_;
};

bool Say(TcpLink* link, const std::string& channel, int number, size_t size = 1) {
  std::vector<uint8_t> data(size);
  data[0] = static_cast<uint8_t>(number);
  return link->Publish(channel, data.data(), static_cast<int>(size));
}

bool HandleUntil(TcpLink* link, const std::function<bool()>& done, int timeout_ms = 20000) {
  const auto deadline = Clock::now() + std::chrono::milliseconds(timeout_ms);
  while (!done() && Clock::now() < deadline) link->Handle(10);
  return done();
}

// Runs a proxy by a thread.
class RunningProxy {
 public:
  explicit RunningProxy(int port) : proxy_(port, &control) {
    thread_ = std::thread([this] {
      while (!stop_) proxy_.Spin(5);
    });
  }
  ~RunningProxy() {
    stop_ = true;
    thread_.join();
  }
  int Port() const { return proxy_.Port(); }
  TcpProxy::Control control;

 private:
  TcpProxy proxy_;
  std::atomic<bool> stop_{false};
  std::thread thread_;
};

TEST(TcpLink, HearsWhatItSaysRightAfterItHasSubscribed) {
  RunningHub hub;
  const auto link = std::make_shared<TcpLink>(LinkTo(hub.Port()));
  ASSERT_TRUE(link->IsConnected());
  Listener listener(link, "A");
  for (int i = 0; i < 100; ++i) EXPECT_TRUE(Say(link.get(), "A", i));
  ASSERT_TRUE(HandleUntil(link.get(), [&] { return listener.heard.size() == 100; }));
  std::vector<int> expected(100);
  std::iota(expected.begin(), expected.end(), 0);
  EXPECT_EQ(listener.heard, expected);
}

TEST(TcpLink, SendsWhatWaitsBeforeItGoes) {
  RunningHub hub;
  const auto ear = std::make_shared<TcpLink>(LinkTo(hub.Port()));
  Listener listener(ear, "A"), ready(ear, "READY");
  ASSERT_TRUE(HandleUntil(ear.get(), [&] { return Say(ear.get(), "READY", 1) && !ready.heard.empty(); }));
  {
    TcpLink link(LinkTo(hub.Port()));
    for (int i = 0; i < 50; ++i) EXPECT_TRUE(Say(&link, "A", i, 100000));
  }
  EXPECT_TRUE(HandleUntil(ear.get(), [&] { return listener.heard.size() == 50; }));
}

TEST(TcpLink, AHubThatStopsHoldsUpNobodyAndIsFoundOutWithinFiveSeconds) {
  RunningHub hub;
  const auto link = std::make_shared<TcpLink>(LinkTo(hub.Port()));
  Listener listener(link, "A");
  ASSERT_TRUE(HandleUntil(link.get(), [&] { return Say(link.get(), "A", 1) && !listener.heard.empty(); }));
  hub.Stop(true);
  const auto begin = Clock::now();
  double longest = 0, found_s = -1;
  const double cpu = CpuSeconds();
  while (SecondsSince(begin) < 8) {
    const auto before = Clock::now();
    Say(link.get(), "A", 2, 300000);  // more than all buffers hold
    longest = std::max(longest, SecondsSince(before));
    link->Handle(20);
    if (found_s < 0 && !link->IsConnected()) found_s = SecondsSince(begin);
  }
  EXPECT_LT(longest, 1.0);  // what a busy machine may take; the hub stood for eight
  EXPECT_GT(found_s, 0);
  EXPECT_LT(found_s, 6);               // five, and what a busy machine may take
  EXPECT_LT(CpuSeconds() - cpu, 4.0);  // it does not spin: a thread of its own would take eight
  hub.Stop(false);
  listener.heard.clear();
  EXPECT_TRUE(HandleUntil(link.get(), [&] {
    Say(link.get(), "A", 3);
    return !listener.heard.empty() && listener.heard.back() == 3;
  }));
}

TEST(TcpLink, ALinkThatIsCutIsFoundOutAndMadeAnew) {
  RunningHub hub;
  RunningProxy proxy(hub.Port());
  const auto link = std::make_shared<TcpLink>(LinkTo(proxy.Port()));
  Listener listener(link, "A");
  ASSERT_TRUE(HandleUntil(link.get(), [&] { return Say(link.get(), "A", 1) && !listener.heard.empty(); }));
  const int64_t number = link->ConnectionNumber();
  proxy.control.is_cut = true;
  auto begin = Clock::now();
  // It only listens: nothing of its own could fail.
  ASSERT_TRUE(HandleUntil(link.get(), [&] { return !link->IsConnected(); }));
  EXPECT_LT(SecondsSince(begin), 6);
  EXPECT_FALSE(Say(link.get(), "A", 2));
  proxy.control.is_cut = false;
  begin = Clock::now();
  listener.heard.clear();
  EXPECT_TRUE(HandleUntil(link.get(), [&] {
    Say(link.get(), "A", 3);
    return !listener.heard.empty();
  }));
  EXPECT_LT(SecondsSince(begin), 6);
  EXPECT_GT(link->ConnectionNumber(), number);
}

TEST(TcpLink, ASlowLinkIsNotADeadOne) {
  RunningHub hub;
  RunningProxy proxy(hub.Port());
  proxy.control.delay_ms = 1200;  // each way
  const auto link = std::make_shared<TcpLink>(LinkTo(proxy.Port()));
  ASSERT_TRUE(HandleUntil(link.get(), [&] { return link->IsConnected(); }));
  const int64_t number = link->ConnectionNumber();
  HandleUntil(
      link.get(), [&] { return link->ConnectionNumber() != number; }, 9000);
  EXPECT_EQ(link->ConnectionNumber(), number);
}

TEST(TcpLink, SaysSoWhenTooMuchIsOnItsWayAndDropsOldImages) {
  RunningHub hub;
  TcpLinkOptions options = LinkTo(hub.Port());
  options.outgoing.reliable_bytes = options.outgoing.best_effort_bytes = 1 << 20;
  TcpLink link(options);
  hub.Stop(true);
  int num_taken = 0;
  while (num_taken < 1000 && Say(&link, "MAPMEND_KEYFRAME", 1, 100000)) ++num_taken;
  EXPECT_LT(num_taken, 1000);  // the kernel's buffers and ours
  for (int i = 0; i < 100; ++i) EXPECT_TRUE(Say(&link, "MAPMEND_IMAGE", i, 100000));
  hub.Stop(false);
}

TEST(TcpLink, KeepsTheNewestOfAChannelThatWantsNoMore) {
  RunningHub hub;
  const auto link = std::make_shared<TcpLink>(LinkTo(hub.Port()));
  Listener latest(link, "A", Delivery::kLatest), all(link, "B");
  for (int i = 0; i < 10; ++i) Say(link.get(), "A", i);
  Say(link.get(), "B", 1);
  std::this_thread::sleep_for(std::chrono::milliseconds(500));  // all are here, nobody has handled them
  ASSERT_TRUE(HandleUntil(link.get(), [&] { return !all.heard.empty(); }));
  EXPECT_EQ(latest.heard, (std::vector<int>{8, 9}));
}

TEST(TcpLink, WhoDoesNotHandleIsNotFilledWithoutEnd) {
  RunningHub hub;
  TcpLinkOptions options = LinkTo(hub.Port());
  options.incoming_bytes = 1 << 20;
  const auto slow = std::make_shared<TcpLink>(options);
  Listener listener(slow, "A"), ready(slow, "READY");
  ASSERT_TRUE(HandleUntil(slow.get(), [&] { return Say(slow.get(), "READY", 1) && !ready.heard.empty(); }));
  const int64_t number = slow->ConnectionNumber();
  TcpLink loud(LinkTo(hub.Port()));
  int num_sent = 0;
  const auto begin = Clock::now();
  while (SecondsSince(begin) < 6) {  // also longer than a dead hub would be given
    if (num_sent < 100 && Say(&loud, "A", num_sent, 100000)) ++num_sent;
    std::this_thread::sleep_for(std::chrono::milliseconds(2));
  }
  EXPECT_TRUE(HandleUntil(slow.get(), [&] { return static_cast<int>(listener.heard.size()) == num_sent; }));
  EXPECT_EQ(slow->ConnectionNumber(), number);
}

TEST(TcpLink, ANameThatCannotBeLookedUpIsAHubThatIsNotThere) {
  TcpLinkOptions options;
  options.host = "no-such-host.invalid";
  const auto begin = Clock::now();
  {
    TcpLink link(options);
    EXPECT_FALSE(link.IsConnected());
    EXPECT_FALSE(Say(&link, "A", 1));
    EXPECT_EQ(link.Handle(10), 0);
  }
  EXPECT_LT(SecondsSince(begin), 4);
}

}  // namespace tcp_link_test
}  // namespace mapmend
