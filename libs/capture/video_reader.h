#pragma once

#include <atomic>
#include <cstdint>
#include <memory>
#include <optional>
#include <string>

namespace cv {
class Mat;
}  // namespace cv

namespace mapmend {

// What the container says before anything is decoded.
struct VideoInfo {
  int width = 0, height = 0;
  double fps = 0;                         // average; 0 if unknown
  bool has_times = false;                 // false: a bare stream of pictures; frames follow each other at fps
  int num_frames = 0;                     // exactly, if the container has a list of them; else 0
  int frames_hint = 0;                    // about so many, for a progress line; 0 if nobody knows
  std::optional<int64_t> creation_utime;  // microseconds since 1970, whole seconds
  std::string track_note;                 // for a person, if the video has several tracks
};

// Decodes one video, file or network stream, with libavformat and libavcodec. Of several tracks the one with the most
// frames is taken, of those the largest: cameras put covers and previews beside the flight, some before it. Pictures
// are as they are stored: a tag that asks to rotate them is ignored. The same file gives the same pictures.
class VideoReader {
 public:
  // A file, whatever characters are in its name. Throws std::runtime_error with one line.
  explicit VideoReader(const std::string& path);
  // A network stream (rtsp://...). Opening, and each frame, may take timeout_s; *stop ends a wait from another thread.
  VideoReader(const std::string& url, double timeout_s, const std::atomic<bool>* stop);
  ~VideoReader();

  const VideoInfo& Info() const;
  // Decodes the next frame. False at the end.
  bool Grab();
  // Of the frame that was grabbed: BGR; empty if it could not be converted.
  cv::Mat Pixels();
  // When the frame is to be shown, microseconds since the first one; nullopt if the container does not say.
  std::optional<int64_t> Utime() const;
  // After the end: one line if data is missing that the container announced, else empty.
  std::string Cut() const;
  // Parts of the frame were missing, and are made up.
  bool IsDamaged() const;
  // Pieces of data so far from which no frame could be made.
  int NumDamaged() const;

 private:
  class Impl;
  std::unique_ptr<Impl> impl_;
};

}  // namespace mapmend
