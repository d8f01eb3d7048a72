#pragma once

#include <cstdint>
#include <map>
#include <string>
#include <vector>

#include "libs/positioning/position_file.h"

namespace mapmend {

// Positions of a flight from files, handed out as its frames come.
class PositionSource {
 public:
  PositionSource() = default;  // none

  // What to read for a flight of these inputs, and a line for the user about it.
  //   path    a file of positions; "exif": the photos; "none"; empty: the photos, or subtitles beside the video, if
  //   they
  //           tell any
  //   images  of the flight in the order of its frames; empty: it is a video
  // Throws std::runtime_error with one line if what was asked for cannot be had.
  static PositionSource Open(const std::string& path, const std::string& origin, const std::vector<std::string>& inputs,
                             const std::vector<std::string>& images);

  bool IsEmpty() const { return by_time_.empty() && by_frame_.empty(); }
  // For a person; empty if there are none.
  const std::string& Note() const { return note_; }
  // The file that they are from; empty: none, or photos.
  const std::string& Path() const { return path_; }

  // Those that have their time with this frame, or belong to it by its name.
  std::vector<PositionFix> TakeFor(int frame, int64_t utime);
  std::vector<PositionFix> TakeRest();
  // Those of this time and earlier are not handed out.
  void PassOver(int64_t utime);

 private:
  void ReadPhotos(const std::vector<std::string>& images);
  void Assign(const PositionFile& file, const std::string& path, const std::vector<std::string>& images);
  std::vector<PositionFix> TakeUntil(int64_t utime);

  std::vector<PositionFix> by_time_;     // ascending; of the clock, or since the first frame
  std::map<int, PositionFix> by_frame_;  // index in the input
  bool since_first_frame_ = false;
  size_t next_ = 0;  // of by_time_
  int64_t passed_ = INT64_MIN;
  std::string note_, path_;
};

}  // namespace mapmend
