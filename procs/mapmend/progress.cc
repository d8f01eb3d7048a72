#include "procs/mapmend/progress.h"

#include <sys/ioctl.h>
#include <unistd.h>

#include <algorithm>
#include <cmath>
#include <cstdio>

namespace mapmend {
namespace {

constexpr double kTerminalInterval = 0.1, kPlainInterval = 5.0;  // seconds

}  // namespace

Progress::Progress(bool quiet) : quiet_(quiet), terminal_(isatty(STDOUT_FILENO) != 0) {}

Progress::~Progress() {
  if (shown_width_ > 0) std::printf("\n");
  std::fflush(stdout);
}

void Progress::Show(const std::string& text) {
  if (quiet_) return;
  const auto now = Clock::now();
  const double since = last_ == Clock::time_point() ? 1e9 : std::chrono::duration<double>(now - last_).count();
  if (text == last_text_ || since < (terminal_ ? kTerminalInterval : kPlainInterval)) return;
  last_ = now;
  last_text_ = text;
  if (terminal_) {
    const std::string line = FitToWidth(text, TerminalColumns());
    std::printf("\r%-*s", static_cast<int>(shown_width_), line.c_str());
    shown_width_ = line.size();
  } else {
    std::printf("%s\n", text.c_str());
  }
  std::fflush(stdout);
}

void Progress::Say(const std::string& line) {
  if (quiet_) return;
  if (shown_width_ > 0) std::printf("\r%-*s\r", static_cast<int>(shown_width_), "");
  shown_width_ = 0;
  std::printf("%s\n", line.c_str());
  std::fflush(stdout);
}

int TerminalColumns() {
  winsize size{};
  return ioctl(STDOUT_FILENO, TIOCGWINSZ, &size) == 0 ? size.ws_col : 0;
}

std::string FitToWidth(const std::string& text, int columns) {
  // The last column stays free: some terminals go on to the next line when it is filled.
  const int room = columns - 1;
  if (columns <= 0 || static_cast<int>(text.size()) <= room) return text;
  if (room <= 3) return text.substr(0, static_cast<size_t>(std::max(0, room)));
  return text.substr(0, static_cast<size_t>(room - 3)) + "...";
}

std::string FormatDuration(double seconds) {
  const long total = std::lround(seconds);
  char text[32];
  if (total >= 3600) {
    std::snprintf(text, sizeof(text), "%ld:%02ld:%02ld", total / 3600, total / 60 % 60, total % 60);
  } else {
    std::snprintf(text, sizeof(text), "%ld:%02ld", total / 60, total % 60);
  }
  return text;
}

}  // namespace mapmend
