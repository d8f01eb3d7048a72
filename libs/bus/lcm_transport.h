#pragma once

#include <lcm/lcm.h>

#include <map>
#include <mutex>

#include "libs/bus/transport.h"

namespace mapmend {

// memq, udpm and file by liblcm. Not tcpq: liblcm waits without end for a hub that has stopped.
class LcmTransport : public Transport {
 public:
  // Throws std::runtime_error with one line if liblcm cannot use the URL.
  explicit LcmTransport(const std::string& url);
  ~LcmTransport() override;

  void Add(std::shared_ptr<Subscriber> subscriber) override;
  void Remove(const Subscriber* subscriber) override;
  bool Publish(const std::string& channel, const uint8_t* data, int size) override;
  int Handle(int timeout_ms) override;
  bool IsConnected() const override { return true; }

 private:
  struct Entry {
    std::shared_ptr<Subscriber> subscriber;
    lcm_subscription_t* subscription = nullptr;
  };
  static void Dispatch(const lcm_recv_buf_t* buffer, const char* channel, void* user);

  lcm_t* lcm_;
  std::mutex mutex_, publish_mutex_;
  std::map<const Subscriber*, Entry> entries_;
};

}  // namespace mapmend
