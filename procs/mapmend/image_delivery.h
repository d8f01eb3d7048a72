#pragma once

#include <chrono>
#include <functional>
#include <memory>
#include <set>
#include <string>

#include "libs/images/image_sender.h"
#include "libs/wire/store_client.h"
#include "procs/mapmend/run_summary.h"

namespace mapmend {

class Backend;

// Images of keyframes that a frontend, which has ended, has left in its spool: sends them as the store asks, and says
// of all others that there are none, so that nobody waits for them.
class ImageDelivery {
 public:
  // spool: a file that need not exist.  sessions: those that the store holds.
  ImageDelivery(Backend* backend, const std::string& spool, const std::set<std::string>& sessions);
  ~ImageDelivery();

  // Keeps the processes going until the store has all that there is, or nothing has come for a while, and until the
  // exports hold what is stored. A spool of which nothing is needed any more is removed.
  //   tick  looks after the processes for a moment
  //   show  a line about how far it is
  ImageFigures Finish(const std::function<void()>& tick, const std::function<void(const std::string&)>& show);

 private:
  Backend* backend_;
  std::unique_ptr<ImageFile> file_;
  std::unique_ptr<ImageSender> sender_;
  std::unique_ptr<StoreClient> store_;  // until Finish: the bus goes before this does
};

// "stored 120 of 162 images, 3.2 MB to come"
std::string DescribeImages(const ImageStatus& status, const ImageFile& spool);

}  // namespace mapmend
