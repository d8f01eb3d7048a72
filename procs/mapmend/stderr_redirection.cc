#include "procs/mapmend/stderr_redirection.h"

#include <fcntl.h>
#include <unistd.h>

#include <cstdio>

namespace mapmend {

StderrRedirection::StderrRedirection(const std::string& path) {
  const int file = open(path.c_str(), O_WRONLY | O_CREAT | O_APPEND | O_CLOEXEC, 0644);
  if (file < 0) return;
  std::fflush(stderr);
  saved_ = fcntl(STDERR_FILENO, F_DUPFD_CLOEXEC, 3);
  dup2(file, STDERR_FILENO);
  close(file);
}

StderrRedirection::~StderrRedirection() {
  if (saved_ < 0) return;
  std::fflush(stderr);
  dup2(saved_, STDERR_FILENO);
  close(saved_);
}

}  // namespace mapmend
