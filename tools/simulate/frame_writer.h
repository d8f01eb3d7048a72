#pragma once

#include <sys/types.h>

#include <memory>
#include <string>

#include "tools/simulate/renderer.h"

namespace mapmend::simulate {

// Takes the frames of a run in order. What it writes has a name ending in .part until Finish, so that nothing
// half-written looks whole; without Finish the destructor removes it. Every method throws std::runtime_error with one
// line naming the file and the reason (a full disk, say).
class FrameWriter {
 public:
  virtual ~FrameWriter() = default;
  virtual void Write(const Frame& frame) = 0;
  virtual void Finish() = 0;

  // H.264 in DIR/video.mp4 through the program ffmpeg. Its number of threads is fixed, because the stream depends on
  // it.
  static std::unique_ptr<FrameWriter> Video(const std::string& dir, int width, int height, double fps, int crf);
  // DIR/images/000000.png and so on.
  static std::unique_ptr<FrameWriter> Images(const std::string& dir);
};

}  // namespace mapmend::simulate
