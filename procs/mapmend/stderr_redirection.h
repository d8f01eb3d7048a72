#pragma once

#include <string>

namespace mapmend {

// Sends this process's standard error to a file (appending) for as long as it lives: liblcm reports its connections
// there, where only the one line of an error belongs.
class StderrRedirection {
 public:
  explicit StderrRedirection(const std::string& path);  // if the file cannot be opened, nothing is redirected
  ~StderrRedirection();
  StderrRedirection(const StderrRedirection&) = delete;
  StderrRedirection& operator=(const StderrRedirection&) = delete;

 private:
  int saved_ = -1;
};

}  // namespace mapmend
