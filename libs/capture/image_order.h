#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <vector>

namespace mapmend {

// Puts what a camera sends into one growing order, whatever its clock does, and keeps out what somebody else sends on
// the same channel. An image that does not follow the last good one (its time or its number goes back, or its time
// leaps ahead) is held. If the next good one follows the last, the one that was held was a stray, and is refused. If
// two more come that follow the held one, the camera's clock was set, or the camera was started again: they are taken,
// and where times would go back they are moved so that they grow.
class ImageOrder {
 public:
  struct Good {
    int64_t id = 0;     // as Add numbered it
    int index = 0;      // of the frame: the camera's own number where it grows
    int64_t utime = 0;  // growing
  };
  struct Decision {
    int64_t id = 0;               // of the image that was added, from 0
    std::vector<Good> good;       // to be taken now, in order; may be of earlier ones
    std::vector<int64_t> strays;  // to be refused for good
    std::string held_because;     // the image waits for others that confirm it
    std::string event;            // one line for the user: the clock was set; somebody else sends, too
  };
  // utime, frame    as the camera says; frame may be 0 for each
  // arrival_us      of a monotonic clock
  Decision Add(int64_t utime, int frame, int64_t arrival_us);
  int NumHeld() const { return static_cast<int>(held_.size()); }

 private:
  struct Image {
    int64_t id = 0, utime = 0, arrival_us = 0;
    int frame = 0;
  };
  // Empty if b may come after a.
  std::string WhyNotAfter(const Image& a, const Image& b) const;
  void Take(const Image& image, Decision* decision);
  void TakeHeld(Decision* decision);

  std::optional<Image> last_;
  std::vector<Image> held_;
  bool is_numbered_ = false;  // the camera counts its frames
  int64_t next_id_ = 0, offset_us_ = 0, last_utime_ = 0;
  int last_index_ = -1;
  std::vector<int64_t> strays_of_late_;  // ids
};

}  // namespace mapmend
