#include "libs/bus/connection_notice.h"

#include <fcntl.h>
#include <sys/mman.h>
#include <unistd.h>

#include <cstdio>
#include <string>

namespace mapmend {

std::mutex ConnectionNoticeFilter::mutex_;

ConnectionNoticeFilter::ConnectionNoticeFilter() : lock_(mutex_) {
  held_ = memfd_create("stderr", MFD_CLOEXEC);
  if (held_ < 0) return;  // then the notice is written
  std::fflush(stderr);
  saved_ = fcntl(STDERR_FILENO, F_DUPFD_CLOEXEC, 3);
  if (saved_ >= 0) dup2(held_, STDERR_FILENO);
}

ConnectionNoticeFilter::~ConnectionNoticeFilter() {
  if (saved_ >= 0) {
    std::fflush(stderr);
    dup2(saved_, STDERR_FILENO);
    close(saved_);
    std::string text, chunk(4096, 0);
    lseek(held_, 0, SEEK_SET);
    for (ssize_t n = 0; (n = read(held_, chunk.data(), chunk.size())) > 0;)
      text.append(chunk, 0, static_cast<size_t>(n));
    const std::string notice = "LCM tcpq: connecting...\n";
    for (size_t at = 0; (at = text.find(notice, at)) != std::string::npos;) text.erase(at, notice.size());
    std::fwrite(text.data(), 1, text.size(), stderr);
    std::fflush(stderr);
  }
  if (held_ >= 0) close(held_);
}

}  // namespace mapmend
