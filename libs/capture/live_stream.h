#pragma once

#include <string>

#include "libs/capture/image_stream.h"

namespace mapmend {

// Images that come as they are taken. There may be none for long; what is no good is counted, and the flight goes on.
class LiveStream : public ImageStream {
 public:
  // Images that could not be used.
  virtual int64_t NumBad() const = 0;
  // What was wrong with the last of them; empty: nothing.
  virtual std::string LastProblem() const = 0;
  // What a person should hear of at once, e.g. that the camera is gone; empty: nothing now. NumNews grows with each.
  virtual std::string News() const = 0;
  virtual int64_t NumNews() const = 0;
  // How messages call the source, e.g. "channel MAPMEND_IMAGE".
  virtual std::string Name() const = 0;
};

}  // namespace mapmend
