#include <algorithm>
#include <cmath>
#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <opencv2/core/utils/logger.hpp>
#include <opencv2/videoio.hpp>
#include <set>
#include <stdexcept>

#include "libs/capture/image_source.h"
#include "libs/command_line/command_line.h"
#include "libs/geometry/camera.h"
#include "libs/geometry/times_file.h"
#include "libs/geometry/trajectory_file.h"
#include "libs/retrieval/vocabulary.h"
#include "procs/mapmend/paths.h"
#include "procs/mapmend/run_options.h"

namespace mapmend {
namespace {

namespace fs = std::filesystem;

[[noreturn]] void Fail(const std::string& what) { throw std::runtime_error(what); }

void RequireReadableFile(const std::string& path, const std::string& what) {
  std::error_code error;
  if (!fs::exists(path, error)) Fail(what + " " + path + " does not exist");
  if (fs::is_directory(path, error)) Fail(what + " " + path + " is a folder");
  if (!std::ifstream(path)) Fail(what + " " + path + " cannot be read");
}

// Number of images in a folder, by the endings that OpenCV reads.
int CountImages(const std::string& folder) {
  static const std::set<std::string> kEndings = {".jpg",  ".jpeg", ".png", ".bmp", ".tif",
                                                 ".tiff", ".pgm",  ".ppm", ".webp"};
  int count = 0;
  std::error_code error;
  fs::directory_iterator entries(folder, error);
  if (error) Fail("input folder " + folder + " cannot be read: " + error.message());
  for (const auto& entry : entries) {
    std::string ending = entry.path().extension().string();
    std::transform(ending.begin(), ending.end(), ending.begin(), [](unsigned char c) { return std::tolower(c); });
    if (kEndings.contains(ending)) ++count;
  }
  if (count == 0) Fail("input folder " + folder + " holds no images (jpg, png, bmp, tif, pgm, ppm, webp)");
  return count;
}

// Opens a video and decodes its first frame. Returns the number of frames its header gives, 0 if it gives none.
int ProbeVideo(const std::string& path) {
  setenv("OPENCV_FFMPEG_LOGLEVEL", "-8", 0);
  cv::utils::logging::setLogLevel(cv::utils::logging::LOG_LEVEL_SILENT);
  cv::VideoCapture video(path, cv::CAP_FFMPEG);
  if (!video.isOpened())
    Fail("input " + path +
         " cannot be opened as a video: unknown format, or cut short (an mp4 has its index at its end)");
  if (!video.grab()) Fail("input " + path + ": the video holds no frame that can be decoded");
  const double count = video.get(cv::CAP_PROP_FRAME_COUNT);
  return std::isfinite(count) && count > 0 && count < 1e9 ? static_cast<int>(count) : 0;
}

void CheckVocabulary(RunInputs* inputs) {
  RunOptions& options = inputs->options;
  if (options.vocabulary.empty()) options.vocabulary = DefaultVocabulary();
  if (options.vocabulary.empty()) {
    Fail("no vocabulary: vocabulary/mapmend.voc is missing from mapmend's data; give one with --vocabulary");
  }
  RequireReadableFile(options.vocabulary, "vocabulary");
  inputs->vocabulary_hash = Vocabulary::Read(options.vocabulary).Hash();
}

// What concerns the camera file and the input, for a camera on the bus.
void CheckLiveInput(RunOptions* options) {
  const auto refuse = [](bool given, const char* what) {
    if (given) Fail(std::string(what) + " does not go with --live: the images come over the bus");
  };
  refuse(!options->input.empty(), "INPUT");
  refuse(!options->times.empty(), "--times");
  refuse(!options->skip_frames.empty(), "--skip-frames");
  if (options->camera.empty()) Fail("no camera file: give one with --camera");
  if (options->out.empty()) options->out = "mapmend-live";
  RequireReadableFile(options->camera, "camera file");
  const Camera camera = ReadCamera(options->camera);
  if (camera.width <= 0 || camera.height <= 0) {
    Fail("camera file " + options->camera + ": does not say width and height, which --live needs");
  }
}

// The same for a file. Notes what was found beside it.
void CheckFileInput(RunInputs* inputs) {
  RunOptions& options = inputs->options;
  std::error_code error;
  if (options.input.empty()) throw UsageError("no input: give a video file or a folder of images, or --live");
  if (!fs::exists(options.input, error)) Fail("input " + options.input + " does not exist");
  const bool is_folder = fs::is_directory(options.input, error);

  const fs::path input = fs::absolute(options.input).lexically_normal();
  const fs::path stem = is_folder && input.filename().empty() ? input.parent_path().filename() : input.stem();
  if (options.out.empty()) options.out = "mapmend-" + stem.string();

  // camera.yaml and times.txt beside a video, or in the folder of images.
  const fs::path beside = is_folder ? input : input.parent_path();
  if (options.camera.empty()) {
    const fs::path path = beside / "camera.yaml";
    if (!fs::exists(path, error))
      Fail("no camera file: give one with --camera (there is no camera.yaml beside the input either)");
    options.camera = path.string();
    inputs->notes.push_back("camera " + options.camera + " (found beside the input)");
  }
  RequireReadableFile(options.camera, "camera file");
  ReadCamera(options.camera);
  if (options.times.empty() && fs::exists(beside / "times.txt", error)) {
    options.times = (beside / "times.txt").string();
    inputs->notes.push_back("times " + options.times + " (found beside the input)");
  }

  inputs->num_frames = is_folder ? CountImages(options.input) : ProbeVideo(options.input);
  if (!options.times.empty()) {
    RequireReadableFile(options.times, "times file");
    const FrameTimes times = ReadFrameTimes(options.times);
    if (!times.note.empty()) inputs->notes.push_back(times.note);
    const int num_times = static_cast<int>(times.utimes.size());
    if (num_times < inputs->num_frames) {
      Fail("times file " + options.times + " has " + std::to_string(num_times) + " lines for " +
           std::to_string(inputs->num_frames) + " frames; it needs one for each");
    }
  }
  ParseFrameRanges(options.skip_frames);
}

}  // namespace

RunInputs CheckRunInputs(const RunOptions& given) {
  RunInputs inputs;
  inputs.options = given;
  RunOptions& options = inputs.options;
  if (options.live)
    CheckLiveInput(&options);
  else
    CheckFileInput(&inputs);
  if (options.speed && !options.realtime) throw UsageError("--speed needs --realtime");
  if (options.max_waiting && !options.realtime && !options.live)
    throw UsageError("--max-waiting needs --realtime or --live");
  if (!options.groundtruth.empty()) {
    RequireReadableFile(options.groundtruth, "ground truth");
    if (ReadTrajectory(options.groundtruth).empty()) Fail("ground truth " + options.groundtruth + " holds no pose");
  }
  if (options.features && *options.features < 100)
    Fail("--features " + std::to_string(*options.features) + ": at least 100");
  if (options.max_dimension && *options.max_dimension < 0) Fail("--max-dimension must not be negative");
  if (options.overwrite && options.append) throw UsageError("--overwrite and --append exclude each other");
  CheckVocabulary(&inputs);
  return inputs;
}

}  // namespace mapmend
