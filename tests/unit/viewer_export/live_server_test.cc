#include "procs/viewer_export/live_server.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <httplib.h>
#include <unistd.h>

#include <filesystem>

#include "libs/base/write_file.h"

namespace mapmend {
namespace {

using ::testing::HasSubstr;

class LiveServerTest : public ::testing::Test {
 protected:
  LiveServerTest() : dir_(std::filesystem::temp_directory_path() / ("mapmend_live_" + std::to_string(getpid()))) {
    std::filesystem::create_directories(dir_);
    // A port that is free now: bound, read, and given back.
    const int probe = socket(AF_INET, SOCK_STREAM, 0);
    sockaddr_in address{};
    address.sin_family = AF_INET;
    address.sin_addr.s_addr = htonl(INADDR_LOOPBACK);
    socklen_t size = sizeof(address);
    EXPECT_EQ(bind(probe, reinterpret_cast<sockaddr*>(&address), size), 0);
    EXPECT_EQ(getsockname(probe, reinterpret_cast<sockaddr*>(&address), &size), 0);
    port_ = ntohs(address.sin_port);
    close(probe);
  }
  ~LiveServerTest() override { std::filesystem::remove_all(dir_); }
  std::filesystem::path dir_;
  int port_ = 0;
};

TEST_F(LiveServerTest, ServesPageStateAndReport) {
  LiveServer server("127.0.0.1", port_, dir_.string());
  EXPECT_FALSE(server.WantsState()) << "nobody has asked yet";
  server.SetState("{\"state\":\"waiting\"}");
  httplib::Client client("127.0.0.1", port_);
  auto answer = client.Get("/");
  ASSERT_TRUE(answer);
  EXPECT_THAT(answer->body, HasSubstr("<title>mapmend</title>"));
  for (const char* external : {"http://", "https://", "src="})
    EXPECT_EQ(answer->body.find(external), std::string::npos);
  answer = client.Get("/state.json");
  ASSERT_TRUE(answer);
  EXPECT_EQ(answer->body, "{\"state\":\"waiting\"}");
  EXPECT_TRUE(server.WantsState());
  EXPECT_EQ(client.Get("/report")->status, 404);
  WriteFile((dir_ / "report.html").string(), "<p>done</p>");
  WriteFile((dir_ / "summary.json").string(), "{}");
  EXPECT_EQ(client.Get("/report")->body, "<p>done</p>");
  EXPECT_EQ(client.Get("/files/summary.json")->body, "{}");
  EXPECT_EQ(client.Get("/files/../../etc/passwd")->status, 404);
}

TEST_F(LiveServerTest, APortInUseIsOneClearLine) {
  const LiveServer first("127.0.0.1", port_, "");
  try {
    const LiveServer second("127.0.0.1", port_, "");
    FAIL();
  } catch (const std::runtime_error& e) {
    EXPECT_THAT(e.what(), HasSubstr("cannot listen on 127.0.0.1:" + std::to_string(port_)));
  }
}

}  // namespace
}  // namespace mapmend
