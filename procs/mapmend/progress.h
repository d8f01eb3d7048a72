#pragma once

#include <chrono>
#include <string>

namespace mapmend {

// One line that says how far a run is: rewritten in place on a terminal, else a new line every few seconds.
class Progress {
 public:
  explicit Progress(bool quiet = false);  // quiet: nothing is printed
  ~Progress();                            // ends the line

  // Shows text, cut to the terminal's width; at most ten times a second on a terminal, else when `interval_s` have
  // passed since the last line.
  void Show(const std::string& text);
  // A line of its own that stays.
  void Say(const std::string& line);

 private:
  using Clock = std::chrono::steady_clock;
  bool quiet_, terminal_;
  size_t shown_width_ = 0;  // characters of the line that stands there
  std::string last_text_;
  Clock::time_point last_;
};

// Of the terminal on standard output; 0 if it is none.
int TerminalColumns();

// The text, cut to fit a terminal of so many columns (0: unknown, nothing is cut), with "..." where it was cut.
std::string FitToWidth(const std::string& text, int columns);

// "1:05" or "1:02:05"; seconds are rounded.
std::string FormatDuration(double seconds);

}  // namespace mapmend
