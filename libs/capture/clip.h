#pragma once

#include <cstdint>
#include <memory>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "libs/capture/decode_image.h"

namespace mapmend {

// One piece of a flight's input as it is stored: a video file, or images in order. Frames come one after the other.
class Clip {
 public:
  struct Facts {
    std::string name;            // as the user gave it
    double fps = 0;              // 0: the input does not say
    int num_frames = 0;          // exactly; 0: nobody knows before the end
    int frames_hint = 0;         // about so many, for a progress line; 0: nobody knows
    bool has_times = false;      // Utime tells
    bool times_are_utc = false;  // of the clock, not since the clip's first frame
    bool is_video = false;
    std::optional<int64_t> creation_utime;  // when a video says that it was begun
    std::vector<std::string> notes;         // for the user, before it begins
    std::string times_note;                 // whence the times are, if not plainly from a video
  };

  virtual ~Clip() = default;
  const Facts& GetFacts() const { return facts_; }
  // Goes to the next frame. False at the end.
  virtual bool Grab() = 0;
  virtual DecodedImage Decode() = 0;
  // Time of the frame, microseconds. nullopt if it is not known.
  virtual std::optional<int64_t> Utime() const = 0;
  // How messages call the frame: a file's name, or "frame 7".
  virtual std::string FrameName() const = 0;
  // After the end: why there may be more than was read; empty if all was there.
  virtual std::string Cut() const { return {}; }
  // After the end: what of the stored bytes could not be read in between; empty if nothing.
  virtual std::string Missing() const { return {}; }
  // Width and height that most of its frames have; {0, 0} if none can be read.
  virtual std::pair<int, int> UsualSize() const = 0;

 protected:
  Facts facts_;
};

// A video, a folder of images, or the images of a list. Throws std::runtime_error with one line that names the input.
std::unique_ptr<Clip> OpenVideoClip(const std::string& path);
std::unique_ptr<Clip> OpenFolderClip(const std::string& folder);
std::unique_ptr<Clip> OpenImagesClip(const std::vector<std::string>& files);

}  // namespace mapmend
