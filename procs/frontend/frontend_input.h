#pragma once

#include <memory>
#include <string>

#include "libs/capture/image_source.h"
#include "libs/capture/live_stream.h"
#include "libs/capture/paced_images.h"
#include "libs/geometry/camera.h"
#include "procs/frontend/resume.h"
#include "procs/frontend/resumed_images.h"
#include "procs/frontend/run_options.h"

namespace mapmend {

// Throws std::runtime_error if the options name no input, or one that does not go with the mode.
void CheckInput(const RunOptions& options);

// The files of a run; null if a camera is flown.
std::unique_ptr<ImageSource> OpenFiles(const RunOptions& options);

// The camera as the images of the input come: most of them tell the size.
//   file  null for a camera, whose calibration must tell it
// Throws std::runtime_error if nobody tells it, or the calibration does not fit.
Camera InputCamera(const RunOptions& options, const ImageSource* file);

// The images of one run: files, in real time or not, or a camera.
class Input {
 public:
  // Last of all that a run sets up: a camera or a clock does not wait.
  //   file  null for a camera
  //   on_passed  see ResumedImages
  Input(const RunOptions& options, const Camera& camera, std::unique_ptr<ImageSource> file, const ResumePoint& resume,
        ResumedImages::OnPassed on_passed = {});

  ImageStream* Stream() const { return paced_ ? paced_.get() : base_; }
  int NumFrames() const { return file_ ? file_->NumFrames() : 0; }  // 0: nobody knows
  int NumPassed() const { return resumed_ ? resumed_->NumPassed() : 0; }
  int FramesHint() const { return file_ ? file_->FramesHint() : 0; }
  int NumLeftOut() const { return file_ ? file_->GetLeftOut().Count() : 0; }
  int64_t NumBad() const { return live_ ? live_->NumBad() : 0; }
  std::string LastProblem() const { return live_ ? live_->LastProblem() : ""; }
  std::string News() const { return live_ ? live_->News() : ""; }
  int64_t NumNews() const { return live_ ? live_->NumNews() : 0; }
  std::string Name() const { return live_ ? live_->Name() : ""; }
  std::string Problem() const { return file_ ? file_->Problem() : ""; }
  void LogLeftOut() const;

 private:
  std::unique_ptr<LiveStream> live_;
  std::unique_ptr<ImageSource> file_;
  std::unique_ptr<ResumedImages> resumed_;  // reads one of them
  ImageStream* base_ = nullptr;             // the last of these three
  std::unique_ptr<PacedImages> paced_;      // reads base_
};

}  // namespace mapmend
