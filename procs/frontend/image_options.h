#pragma once

#include <string>

#include "libs/base/range.h"

namespace mapmend {

// Which images of keyframes are kept for the map, and how.
struct ImageOptions {
  std::string keep;          // "full", "none", or the width in pixels; empty: full for files, 640 of a camera
  int quality = 90;          // of JPEG, for what did not come as one; 0: PNG, without loss
  int rate_kbit_s = -1;      // at most so much is sent to the store; 0: no limit; -1: none on this host, else 4000
  int max_waiting_mb = 256;  // of images that wait to be encoded; beyond it the oldest are given up
  int min_free_mb = 500;     // of the disk: with less, no image is kept, that the stream may have it

  template <typename Visitor>
  void Visit(Visitor& v) {
    v("keep", keep);
    v("quality", quality, Range(0, 100), "of JPEG; 0: PNG");
    v("rate_kbit_s", rate_kbit_s, Range(-1, 1e8), "kbit/s; 0: no limit; -1: 4000, on this host no limit");
    v("max_waiting_mb", max_waiting_mb, Range(1, 1e6), "MB");
    v("min_free_mb", min_free_mb, Range(0, 1e8), "MB of the disk");
  }
  // Empty, or one line.
  std::string Conflict() const;
};

inline constexpr int kFullSize = 0, kNoImages = -1;
// Pixels of width that images are kept with, or one of these two. Throws std::runtime_error naming what is wrong.
int KeptWidth(const ImageOptions& options, bool is_live);

}  // namespace mapmend
