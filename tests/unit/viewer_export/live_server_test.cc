#include "procs/viewer_export/live_server.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <atomic>
#include <cstdlib>
#include <memory>
#include <set>
#include <string>
#include <thread>
#include <vector>

#include "libs/base/write_file.h"
#include "procs/viewer_export/live_feed.h"
#include "procs/viewer_export/live_questions.h"
#include "procs/viewer_export/web_files.h"
#include "tests/scratch_folder.h"
#include "tests/unit/viewer_export/raw_http_client.h"

namespace mapmend {
namespace live_server_test {

using ::testing::HasSubstr;
using ::testing::Not;

constexpr char kToken[] = "0123456789abcdef0123456789abcdef";

class LiveServerTest : public ::testing::Test {
 protected:
  void Start(const std::string& token = kToken) {
    server_ = std::make_unique<LiveServer>(LiveServerOptions{"127.0.0.1", port_, folder_.Path(), token, ""}, &feed_,
                                           &questions_);
  }
  struct Answer {
    int status = 0;
    std::string head, body;
  };
  // Debian's httplib::Client has another size in the library than in a program without OpenSSL.
  Answer Ask(const std::string& request) const {
    const std::string text = RawHttpClient(port_).Ask(request + "\r\n\r\n");
    const size_t end = text.find("\r\n\r\n");
    if (end == std::string::npos) return {};
    return {std::atoi(text.c_str() + text.find(' ')), text.substr(0, end), text.substr(end + 4)};
  }
  Answer Get(const std::string& path) const { return Ask("GET " + path + " HTTP/1.1\r\nHost: localhost"); }
  // The answer to a decision with this token.
  int Decide(const std::string& token, const std::string& disabled = "1") const {
    return Ask("POST /edge?a=0:0&b=0:1&disabled=" + disabled +
               " HTTP/1.1\r\nHost: localhost\r\nContent-Length: 0\r\nX-Mapmend-Token: " + token)
        .status;
  }

  const ScratchFolder folder_;
  const int port_ = FreeTcpPort();
  LiveFeed feed_;
  LiveQuestions questions_;
  std::unique_ptr<LiveServer> server_;
};

TEST_F(LiveServerTest, ServesThePageAndNothingOfOthers) {
  Start();
  const auto page = Get("/");
  EXPECT_THAT(page.body, HasSubstr("<title>mapmend</title>"));
  EXPECT_THAT(page.head, HasSubstr("default-src 'none'; script-src 'self'"));
  EXPECT_THAT(page.head, Not(HasSubstr("unsafe")));
  for (const char* file : {"/page/main.js", "/page/style.css", "/page/icon.svg"}) {
    const auto answer = Get(file);
    EXPECT_EQ(answer.status, 200) << file;
    for (const char* external : {"https://", "url(http", "import(\"http"})
      EXPECT_EQ(answer.body.find(external), std::string::npos) << file;
  }
  for (const char* none : {"/page/", "/page/missing.js", "/page/../live_server.cc", "/lib/", "/lib/three/README.md"})
    EXPECT_EQ(Get(none).status, 404) << none;
}

TEST_F(LiveServerTest, EverythingThatThePageImportsIsThere) {
  for (const char* root : {"/page/main.js", "/page/index.html"}) {
    std::vector<std::string> waiting = {root};
    std::set<std::string> seen;
    while (!waiting.empty()) {
      const std::string path = waiting.back();
      waiting.pop_back();
      if (!seen.insert(path).second || path.starts_with("/lib/")) {
        if (path.starts_with("/lib/")) {
          EXPECT_NE(FindLibraryFile(path, "/x"), "") << path;
        }
        continue;
      }
      const auto file = FindWebFile(path);
      ASSERT_TRUE(file) << path;
      const std::string text(file->content);
      for (const std::string before : {"from \"", "src=\"", "href=\""}) {
        for (size_t at = text.find(before); at != std::string::npos; at = text.find(before, at + 1)) {
          const size_t begin = at + before.size();
          std::string target = text.substr(begin, text.find('"', begin) - begin);
          if (target.starts_with("./")) target = "/page/" + target.substr(2);
          if (target.starts_with("/page/") || target.starts_with("/lib/")) waiting.push_back(target);
        }
      }
    }
    EXPECT_GT(seen.size(), 3u);
  }
}

TEST_F(LiveServerTest, ServesValuesReportAndFiles) {
  Start();
  feed_.Set("run", "{\"state\":\"waiting\"}");
  EXPECT_EQ(Get("/state.json").body, "{\"run\":{\"state\":\"waiting\"}}");
  EXPECT_EQ(Get("/report").status, 404);
  WriteFile(folder_.File("report.html"), "<p>done</p>");
  WriteFile(folder_.File("summary.json"), "{}");
  const auto report = Get("/report");
  EXPECT_EQ(report.body, "<p>done</p>");
  EXPECT_THAT(report.head, Not(HasSubstr("script-src")));
  const auto file = Get("/files/summary.json");
  EXPECT_EQ(file.body, "{}");
  EXPECT_THAT(file.head, HasSubstr("sandbox"));
  EXPECT_EQ(Get("/files/../../etc/passwd").status, 404);
}

TEST_F(LiveServerTest, StreamsWhatChangesFromWhereThePageIs) {
  Start();
  feed_.Set("a", "1");
  const std::string seen = feed_.Epoch() + ":" + std::to_string(feed_.Version());
  feed_.Set("b", "2");
  const RawHttpClient all(port_), rest(port_);
  ASSERT_TRUE(all.Send("GET /events HTTP/1.1\r\nHost: localhost\r\n\r\n"));
  ASSERT_TRUE(rest.Send("GET /events HTTP/1.1\r\nHost: localhost\r\nLast-Event-ID: " + seen + "\r\n\r\n"));
  std::string text = all.ReceiveUntil("\"b\":2");
  EXPECT_THAT(text, HasSubstr("Content-Type: text/event-stream"));
  EXPECT_THAT(text, Not(HasSubstr("Content-Length")));
  EXPECT_THAT(text, HasSubstr("\"set\":{\"a\":1,\"b\":2}"));
  EXPECT_THAT(text, HasSubstr("\nid: " + feed_.Epoch() + ":2\n"));
  EXPECT_THAT(rest.ReceiveUntil("\"b\":2"), HasSubstr("\"set\":{\"b\":2}"));
  EXPECT_EQ(server_->NumPages(), 2);
  feed_.Set("c", "3");
  server_->Wake();
  EXPECT_THAT(all.ReceiveUntil("\"c\":3"), HasSubstr("\"set\":{\"c\":3}"));
  EXPECT_THAT(rest.ReceiveUntil("\"c\":3"), HasSubstr("\"set\":{\"c\":3}"));
}

TEST_F(LiveServerTest, ManyIdleAndSlowPagesKeepNobodyOut) {
  Start();
  for (uint32_t row = 0; row < 100000; ++row) feed_.SetRow("t", row, std::string(40, 'x'));
  std::vector<std::unique_ptr<RawHttpClient>> slow;
  for (int i = 0; i < 60; ++i) {
    slow.push_back(std::make_unique<RawHttpClient>(port_, 4096));
    ASSERT_TRUE(slow.back()->Send("GET /events HTTP/1.1\r\nHost: localhost\r\n\r\n"));
  }
  EXPECT_EQ(Get("/page/main.js").status, 200);
  const RawHttpClient reader(port_);
  ASSERT_TRUE(reader.Send("GET /events HTTP/1.1\r\nHost: localhost\r\n\r\n"));
  const std::string text = reader.ReceiveUntil("\"to\":100000,");
  EXPECT_THAT(text, HasSubstr("\"to\":100000,"));
  EXPECT_LE(server_->NumPages(), 32);
}

TEST_F(LiveServerTest, OnlyTheTokenDecides) {
  Start();
  std::atomic<bool> stop = false;
  std::atomic<int> decisions = 0;
  std::thread map([&] {
    while (!stop) {
      questions_.AnswerOne([&](const LiveQuestions::Question& question) {
        EXPECT_EQ(question.a, "0:0");
        EXPECT_EQ(question.b, "0:1");
        decisions += question.disabled ? 1 : 100;
        return LiveQuestions::Answer{200, "text/plain", "done"};
      });
      std::this_thread::sleep_for(std::chrono::milliseconds(1));
    }
  });
  EXPECT_EQ(Decide(kToken), 200);
  EXPECT_EQ(Decide(kToken, "0"), 200);
  EXPECT_EQ(decisions, 101);
  EXPECT_EQ(Decide(kToken, "maybe"), 400);
  EXPECT_EQ(Decide(""), 403);
  for (int i = 0; i < 8; ++i) EXPECT_EQ(Decide("0123456789abcdef0123456789abcde" + std::to_string(i)), 403);
  EXPECT_EQ(Decide(kToken), 403) << "after too many wrong ones nobody is heard for a while";
  EXPECT_EQ(decisions, 101);
  stop = true;
  map.join();
}

TEST_F(LiveServerTest, WithoutATokenNothingCanBeDecided) {
  Start("");
  EXPECT_EQ(Decide(""), 403);
  EXPECT_EQ(Decide(kToken), 403);
}

TEST_F(LiveServerTest, TooManyQuestionsAreRefusedAtOnce) {
  Start();
  std::vector<std::thread> askers;
  std::atomic<int> refused = 0;
  for (int i = 0; i < 12; ++i) {
    askers.emplace_back([&] {
      const auto answer = Get("/edge.jpg?a=0:0&b=0:1");
      if (answer.status == 503) ++refused;
    });
  }
  while (refused < 6) std::this_thread::sleep_for(std::chrono::milliseconds(5));
  for (int answered = 0; answered < 6;) {
    questions_.AnswerOne([&](const LiveQuestions::Question&) {
      ++answered;
      return LiveQuestions::Answer{404, "text/plain", "none"};
    });
  }
  for (std::thread& asker : askers) asker.join();
  EXPECT_EQ(refused, 6);
}

TEST_F(LiveServerTest, APortInUseIsOneClearLine) {
  Start();
  LiveFeed feed;
  LiveQuestions questions;
  try {
    const LiveServer second({"127.0.0.1", port_, "", "", ""}, &feed, &questions);
    FAIL();
  } catch (const std::runtime_error& e) {
    EXPECT_THAT(e.what(), HasSubstr("cannot listen on 127.0.0.1:" + std::to_string(port_)));
  }
}

}  // namespace live_server_test
}  // namespace mapmend
