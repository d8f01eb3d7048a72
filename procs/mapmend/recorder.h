#pragma once

#include <string>

#include "procs/mapmend/backend.h"

namespace mapmend {

// lcm-logger beside a run. Its file, FOLDER/mapmend.lcmlog, holds everything that was said on mapmend's channels, the
// stream among it; `mapmend replay` maps from it.
class Recorder {
 public:
  // Starts lcm-logger on a path that CheckRecordFolder gave and waits until it has written its first message, so that
  // it misses nothing of what follows. Throws std::runtime_error with one line if it does not record.
  Recorder(Backend* backend, const std::string& path, const std::string& channel_prefix);
  // Tells the user as soon as it has ended. Call now and then.
  void Check();
  // Why the recording is not whole; empty: it is.
  const std::string& Problem() const { return problem_; }
  // Stops it after it has had the time to write all that was said so far.
  void Finish();

 private:
  Backend* backend_;
  std::string path_, problem_;
};

// Checks that lcm-logger is there and FOLDER can hold a recording; makes the folder, removes an old recording if
// overwrite is set. Returns the recording's path. Throws std::runtime_error with one line.
std::string CheckRecordFolder(const std::string& folder, bool overwrite);

// Full path of a program on PATH; empty if there is none.
std::string FindOnPath(const std::string& name);

}  // namespace mapmend
