#pragma once

#include <atomic>
#include <chrono>
#include <memory>
#include <string>
#include <thread>

#include "libs/bus/hub.h"

namespace mapmend {

// A hub on a free port, served by a thread.
class RunningHub {
 public:
  explicit RunningHub(HubOptions options = {}, int port = 0) {
    options.port = port;
    hub_ = std::make_unique<Hub>(options);
    thread_ = std::thread([this] {
      while (!stop_) {
        if (is_stopped_) {
          std::this_thread::sleep_for(std::chrono::milliseconds(5));
        } else {
          hub_->Spin(10);
        }
      }
    });
  }
  ~RunningHub() {
    stop_ = true;
    thread_.join();
  }
  int Port() const { return hub_->Port(); }
  std::string Url() const { return "tcpq://127.0.0.1:" + std::to_string(hub_->Port()); }
  // As SIGSTOP would do: the kernel still takes connections and bytes, nobody answers.
  void Stop(bool is_stopped) { is_stopped_ = is_stopped; }

 private:
  std::unique_ptr<Hub> hub_;
  std::atomic<bool> stop_{false}, is_stopped_{false};
  std::thread thread_;
};

}  // namespace mapmend
