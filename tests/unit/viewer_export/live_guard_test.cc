// The live page among strangers.

#include "procs/viewer_export/live_guard.h"

#include <fcntl.h>
#include <gtest/gtest.h>
#include <sys/stat.h>
#include <unistd.h>

#include <chrono>
#include <filesystem>
#include <fstream>
#include <memory>
#include <string>
#include <thread>
#include <vector>

#include "procs/viewer_export/live_feed.h"
#include "procs/viewer_export/live_questions.h"
#include "procs/viewer_export/live_server.h"
#include "tests/scratch_folder.h"
#include "tests/unit/viewer_export/raw_http_client.h"

namespace mapmend {
namespace live_guard_test {

using Clock = std::chrono::steady_clock;

class LiveGuardTest : public ::testing::Test {
 protected:
  LiveGuardTest() {
    std::filesystem::create_directories(folder_.File("out/pictures"));
    Write("secret", "outside");
    Write("out/summary.json", "{}");
    Write("out/pictures/a.svg", "<svg/>");
    server_ = std::make_unique<LiveServer>(LiveServerOptions{"127.0.0.1", port_, folder_.File("out"), "", ""}, &feed_,
                                           &questions_);
  }
  void Write(const std::string& name, const std::string& text) const { std::ofstream(folder_.File(name)) << text; }
  std::string Get(const std::string& path, const std::string& headers = "Host: localhost\r\n") const {
    return RawHttpClient(port_).Ask("GET " + path + " HTTP/1.1\r\n" + headers + "\r\n");
  }
  static std::string Status(const std::string& answer) { return answer.substr(0, 12); }
  bool PageIsServed() const { return Status(Get("/state.json")) == "HTTP/1.1 200"; }

  const ScratchFolder folder_;
  const int port_ = FreeTcpPort();
  LiveFeed feed_;
  LiveQuestions questions_;
  std::unique_ptr<LiveServer> server_;
};

TEST_F(LiveGuardTest, LinksAndDotsDoNotLeadOutside) {
  namespace fs = std::filesystem;
  fs::create_symlink(folder_.File("secret"), folder_.File("out/absolute"));
  fs::create_symlink("../secret", folder_.File("out/relative"));
  fs::create_directory_symlink("..", folder_.File("out/up"));
  fs::create_symlink("summary.json", folder_.File("out/inside"));
  ASSERT_EQ(mkfifo(folder_.File("out/pipe").c_str(), 0644), 0);
  for (const char* path :
       {"absolute", "relative", "up/secret", "../secret", "%2e%2e/secret", "..%2fsecret", "%2fetc/passwd",
        "pictures/../../secret", "pictures", "", "pipe", "missing", "summary.json%00.html"}) {
    const std::string answer = Get(std::string("/files/") + path);
    EXPECT_EQ(Status(answer), "HTTP/1.1 404") << path;
    EXPECT_EQ(answer.find("outside"), std::string::npos) << path;
  }
  EXPECT_NE(Get("/files/summary.json").find("\r\n\r\n{}"), std::string::npos);
  EXPECT_NE(Get("/files/inside").find("\r\n\r\n{}"), std::string::npos);
  EXPECT_NE(Get("/files/pictures/a.svg").find("image/svg+xml"), std::string::npos);
}

TEST_F(LiveGuardTest, TokensAndPrivateFilesAreNotServed) {
  Write("out/hub.token", "0123456789abcdef");
  Write("out/private", "0123456789abcdef");
  chmod(folder_.File("out").c_str(), 0755);
  chmod(folder_.File("out/private").c_str(), 0600);
  EXPECT_EQ(Status(Get("/files/hub.token")), "HTTP/1.1 404");
  EXPECT_EQ(Status(Get("/files/private")), "HTTP/1.1 404");
}

TEST_F(LiveGuardTest, OtherSitesCannotAsk) {
  const std::string own = OwnHostNames().empty() ? "localhost" : OwnHostNames()[0];
  for (const std::string& host : {std::string("localhost"), std::string("127.0.0.1"), std::string("LOCALHOST:8080"),
                                  std::string("192.168.7.1:9000"), std::string("[::1]:8080"), own, own + ":1234"}) {
    EXPECT_EQ(Status(Get("/state.json", "Host: " + host + "\r\n")), "HTTP/1.1 200") << host;
    EXPECT_EQ(Status(Get("/state.json", "Host: " + host + "\r\nOrigin: http://" + host + "\r\n")), "HTTP/1.1 200")
        << host;
  }
  for (const char* host : {"evil.example", "evil.example:8080", "localhost.evil.example", "127.0.0.1.evil.example", "",
                           "localhost@evil.example", "[evil.example]"}) {
    for (const char* path : {"/", "/state.json", "/events", "/files/summary.json", "/report"})
      EXPECT_EQ(Status(Get(path, std::string("Host: ") + host + "\r\n")), "HTTP/1.1 403") << host;
  }
  EXPECT_EQ(Status(Get("/state.json", "")), "HTTP/1.1 403");
  EXPECT_EQ(Status(Get("/state.json", "Host: localhost\r\nHost: evil.example\r\n")), "HTTP/1.1 403");
  for (const char* origin : {"http://evil.example", "null", "http://localhost.evil.example"})
    EXPECT_EQ(Status(Get("/state.json", std::string("Host: localhost\r\nOrigin: ") + origin + "\r\n")), "HTTP/1.1 403");
}

TEST_F(LiveGuardTest, OnlyReads) {
  EXPECT_EQ(Status(Get("/favicon.ico")), "HTTP/1.1 204");
  for (const char* method : {"POST", "PUT", "DELETE", "OPTIONS"}) {
    const std::string answer =
        RawHttpClient(port_).Ask(std::string(method) + " /state.json HTTP/1.1\r\nHost: localhost\r\n\r\n");
    EXPECT_EQ(Status(answer), "HTTP/1.1 405") << method;
  }
  const std::string head = RawHttpClient(port_).Ask("HEAD /files/summary.json HTTP/1.1\r\nHost: localhost\r\n\r\n");
  EXPECT_EQ(Status(head), "HTTP/1.1 200");
  EXPECT_TRUE(head.ends_with("\r\n\r\n"));
}

TEST_F(LiveGuardTest, RangesAreServedOneAtATime) {
  Write("out/digits", "0123456789");
  const std::string one = Get("/files/digits", "Host: localhost\r\nRange: bytes=2-4\r\n");
  EXPECT_EQ(Status(one), "HTTP/1.1 206");
  EXPECT_TRUE(one.ends_with("\r\n\r\n234")) << one;
  std::string many = "Host: localhost\r\nRange: bytes=0-";
  for (int i = 0; i < 1000; ++i) many += ",0-";
  EXPECT_LT(Get("/files/digits", many + "\r\n").size(), 1000u);
  EXPECT_TRUE(PageIsServed());
}

TEST_F(LiveGuardTest, SlowClientsKeepNobodyOut) {
  std::vector<std::unique_ptr<RawHttpClient>> slow;
  for (int i = 0; i < 40; ++i) slow.push_back(std::make_unique<RawHttpClient>(port_));
  const auto start = Clock::now();
  bool any_cut = false;
  for (int i = 0; i < 80 && !any_cut; ++i) {
    for (const auto& client : slow)
      any_cut = !client->Send(i == 0 ? "GET /state.json HTTP/1.1\r\nX: " : "x") || any_cut;
    EXPECT_TRUE(PageIsServed());
    std::this_thread::sleep_for(std::chrono::milliseconds(100));
  }
  EXPECT_TRUE(any_cut) << "a request may not take for ever";
  EXPECT_LT(Clock::now() - start, std::chrono::seconds(30));
}

TEST_F(LiveGuardTest, IdleClientsUseUpNothing) {
  std::vector<std::unique_ptr<RawHttpClient>> idle;
  for (int i = 0; i < 400; ++i) {
    idle.push_back(std::make_unique<RawHttpClient>(port_));
    if (i % 100 == 99) {
      EXPECT_TRUE(PageIsServed());
    }
  }
  EXPECT_EQ(idle.front()->Receive(), "") << "the oldest had to make room";
}

TEST_F(LiveGuardTest, WhoTakesAnAnswerTooSlowlyIsCutOff) {
  Write("out/large", std::string(30 << 20, 'x'));
  std::vector<std::unique_ptr<RawHttpClient>> slow;
  for (int i = 0; i < 30; ++i) {
    slow.push_back(std::make_unique<RawHttpClient>(port_, 4096));
    slow.back()->Send("GET /files/large HTTP/1.1\r\nHost: localhost\r\n\r\n");
  }
  EXPECT_TRUE(PageIsServed());
  EXPECT_EQ(Get("/files/large").find("HTTP/1.1 503"), 0u) << "no more than a few files at once";
  bool served = false;
  for (int i = 0; i < 200 && !served; ++i) {
    served = Get("/files/large").size() > (30u << 20);
    if (!served) std::this_thread::sleep_for(std::chrono::milliseconds(200));
  }
  EXPECT_TRUE(served);
}

TEST_F(LiveGuardTest, EndsWhileClientsWait) {
  const RawHttpClient idle(port_), begun(port_);
  begun.Send("GET / HT");
  const auto start = Clock::now();
  server_.reset();
  EXPECT_LT(Clock::now() - start, std::chrono::seconds(5));
}

}  // namespace live_guard_test
}  // namespace mapmend
