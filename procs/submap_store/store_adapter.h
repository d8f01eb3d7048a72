#pragma once

#include <functional>
#include <vector>

#include "libs/bus/bus.h"
#include "libs/bus/health.h"
#include "procs/submap_store/request_queue.h"
#include "procs/submap_store/submap_store.h"

namespace mapmend {

class ImageStore;

// Connects a SubmapStore to the bus: records, heartbeats and requests in; acknowledgements (at once after a commit and
// at 20 Hz), replies and health out.
class StoreAdapter {
 public:
  // images: told in the health; may be null.
  StoreAdapter(Bus* bus, SubmapStore* store, const ImageStore* images = nullptr);

  // Handles what has come within timeout_ms. Call in a loop.
  void Spin(int timeout_ms);

 private:
  template <typename Request, typename Reply>
  void Serve(const char* request_channel, const char* reply_channel, std::function<Reply(const Request&)> answer);
  void ReportHealth(int64_t now_ms);
  void TellIncarnation();

  Bus* bus_;
  SubmapStore* store_;
  const ImageStore* images_;
  HealthReporter health_;
  RequestQueue requests_;
  int64_t last_ack_ms_ = 0, last_health_ms_ = 0, last_records_ = 0;
  const int64_t incarnation_;
  bool has_background_work_ = true;
  std::vector<Subscription> subscriptions_;
};

}  // namespace mapmend
