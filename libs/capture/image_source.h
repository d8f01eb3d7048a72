#pragma once

#include <cstdint>
#include <functional>
#include <limits>
#include <memory>
#include <mutex>
#include <optional>
#include <set>
#include <string>
#include <utility>
#include <vector>

#include "libs/base/range.h"
#include "libs/capture/clip.h"
#include "libs/capture/image_stream.h"
#include "libs/capture/left_out.h"
#include "libs/capture/steady_range.h"

namespace mapmend {

struct SourceOptions {
  // Videos, folders of images, or images; the clips of one flight, in order.
  std::vector<std::string> inputs;
  // Asked first, with all inputs, for those that another library knows to read; may be empty, or give null.
  std::function<std::unique_ptr<Clip>(const std::vector<std::string>&)> open_other;
  std::string times_path;  // one time per frame of all inputs; empty: the inputs' own times, else a rate
  double camera_fps = 0;   // that rate where the input has none; 0: 30
  std::set<int> skip;      // indices of frames to leave out
  int every = 1;           // only each so manyth frame
  double start_s = 0;      // only frames from so many seconds after the first one on ...
  double end_s = std::numeric_limits<double>::infinity();  // ... and before this
  int width = 0, height = 0;  // of the images, pixels; others are left out. 0: the size that most of them have

  // Not visited: inputs, open_other, times_path, skip: what is read, and with what.
  template <typename Visitor>
  void Visit(Visitor& v) {
    v("camera_fps", camera_fps, Range(0, 1e6), "Hz; 0: 30 Hz");
    v("every", every, Range(1, 100000), "frames");
    v("start_s", start_s, AtLeast(0), "s");
    v("end_s", end_s, AtLeast(0), "s");
    v("width", width, Range(0, 100000), "pixels; 0: as most images");
    v("height", height, Range(0, 100000), "pixels; 0: as most images");
  }
};

// The frames of a flight's input files. Whoever counts frames and whoever reads them asks this class. A frame that
// cannot be used (unreadable, cut short, of another size, of a time that does not grow) is left out, and counted.
class ImageSource : public ImageStream {
 public:
  // Throws std::runtime_error with one line that names the input if there is nothing to read, or the times file does
  // not fit.
  explicit ImageSource(const SourceOptions& options);
  ~ImageSource() override;

  // Throws std::runtime_error at the end if not one frame could be used.
  std::optional<SourceImage> Next() override;
  // Frames that Next will give, left out ones included: exactly, or 0 if nobody can know.
  int NumFrames() const { return num_frames_; }
  // The same for a progress line; may be wrong.
  int FramesHint() const { return frames_hint_; }
  // Width and height that most frames have.
  std::pair<int, int> UsualSize() const;
  // Lines for the user before it begins: which order, which times, what was passed over.
  const std::vector<std::string>& Notes() const { return notes_; }
  const LeftOut& GetLeftOut() const { return left_out_; }
  // One line if not all of the input could be used, else empty: it ended early, or frames were left out.
  std::string Problem() const;

 private:
  void OpenClips();
  void CheckTimes();
  void CountFrames();
  void TellTimes();
  bool GrabNext();
  void BeginClip();
  void EndOfInput();
  // nullopt if the frame's time does not grow.
  std::optional<int64_t> TimeOfFrame();
  void Refuse(const std::string& why);
  void Miss(const std::string& why);

  SourceOptions options_;
  std::vector<std::unique_ptr<Clip>> clips_;
  std::vector<int64_t> times_;
  std::vector<std::string> notes_;
  int num_frames_ = 0, frames_hint_ = 0;
  bool all_counted_ = true;  // num_frames of every clip is known

  size_t clip_ = 0;
  int index_ = -1;  // of the frame that was grabbed, in the whole input
  int index_in_clip_ = -1;
  int num_given_ = 0;
  int64_t clip_begin_ = 0;  // time of the clip's first frame where clips tell times since then
  int64_t last_step_ = 0;
  int num_back_ = 0;  // frames in a row whose times are before the last good one's
  std::optional<int64_t> first_utime_, last_utime_;
  SteadyRange range_;
  LeftOut left_out_;
  mutable std::mutex mutex_;
  std::string missing_;  // why the input ended early
};

}  // namespace mapmend
