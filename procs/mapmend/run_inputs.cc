#include <algorithm>
#include <filesystem>
#include <fstream>
#include <opencv2/core.hpp>
#include <stdexcept>

#include "libs/base/frame_ranges.h"
#include "libs/capture/device_images.h"
#include "libs/capture/exif_camera.h"
#include "libs/capture/image_list.h"
#include "libs/capture/image_mask.h"
#include "libs/capture/image_source.h"
#include "libs/capture/times_beside.h"
#include "libs/command_line/command_line.h"
#include "libs/geometry/camera.h"
#include "libs/geometry/camera_file.h"
#include "libs/geometry/read_trajectory.h"
#include "libs/image_messages/image_log.h"
#include "libs/positioning/position_source.h"
#include "libs/retrieval/vocabulary.h"
#include "procs/mapmend/paths.h"
#include "procs/mapmend/run_options.h"

namespace mapmend {
namespace {

namespace fs = std::filesystem;

constexpr const char* kGuessedCamera = "camera.yaml";  // in the folder of results
constexpr const char* kHowToGetACamera = "data/cameras has examples, and its README says how to make one";

[[noreturn]] void Fail(const std::string& what) { throw std::runtime_error(what); }

void RequireReadableFile(const std::string& path, const std::string& what) {
  std::error_code error;
  if (!fs::exists(path, error)) Fail(what + " " + path + " does not exist");
  if (fs::is_directory(path, error)) Fail(what + " " + path + " is a folder");
  if (!std::ifstream(path)) Fail(what + " " + path + " cannot be read");
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

// The camera file and the mask against images of a known size.
void CheckAgainstImages(RunInputs* inputs, int width, int height) {
  const RunOptions& options = inputs->options;
  if (inputs->guessed_camera.empty()) {
    const CameraFile file = ReadCameraFor(options.camera, width, height);
    inputs->notes.insert(inputs->notes.end(), file.notes.begin(), file.notes.end());
  }
  if (!options.mask.empty()) ReadMask(options.mask, width, height);
}

// The camera of geotagged photos, as far as they tell it. Without, throws and says how to get a camera file.
Camera TakeCameraFromPhotos(const std::vector<std::string>& files, RunInputs* inputs) {
  std::vector<std::string> photos;
  std::error_code error;
  for (const std::string& file : files) {
    if (!fs::is_directory(file, error)) {
      if (HasImageName(file)) photos.push_back(file);
      continue;
    }
    const std::vector<std::string> found = ListImages(file).files;
    photos.insert(photos.end(), found.begin(), found.end());
  }
  const ExifCamera guess = GuessCamera(photos);
  if (!guess.found) {
    Fail("no camera file: give one with --camera (there is no camera.yaml beside the input either" +
         (guess.note.empty() ? "" : ", and " + guess.note) + "); " + kHowToGetACamera);
  }
  RunOptions& options = inputs->options;
  options.camera = (fs::path(options.out) / kGuessedCamera).string();
  inputs->guessed_camera = FormatCameraFile(guess.camera, {guess.note});
  inputs->notes.push_back(guess.note);
  return guess.camera;
}

// What concerns the camera file and the input, for a camera on the bus.
void CheckLiveInput(RunInputs* inputs) {
  RunOptions* const options = &inputs->options;
  const auto refuse = [](bool given, const char* what) {
    if (given) Fail(std::string(what) + " does not go with --live");
  };
  refuse(!options->inputs.empty(), "INPUT");
  refuse(!options->times.empty(), "--times");
  refuse(!options->skip_frames.empty(), "--skip-frames");
  refuse(options->every.has_value(), "--every");
  refuse(options->start || options->end, "--start or --end");
  refuse(!options->source.empty() && !options->image_channel.empty(), "--image-channel beside --source");
  const bool is_url = DeviceImages::IsDevice(options->source);
  std::error_code error;
  if (!options->source.empty() && !is_url && !fs::is_directory(options->source, error)) {
    Fail("--source " + options->source +
         ": expected /dev/videoN, a URL such as rtsp://HOST/PATH, gst:PIPELINE, or a folder that exists" +
         (fs::exists(options->source, error) ? " (a file is an INPUT, without --live)" : ""));
  }
  if (options->camera.empty() && !options->source.empty() && !is_url &&
      fs::exists(fs::path(options->source) / "camera.yaml", error))
    options->camera = (fs::path(options->source) / "camera.yaml").string();
  if (options->camera.empty()) Fail(std::string("no camera file: give one with --camera; ") + kHowToGetACamera);
  if (options->out.empty()) options->out = "mapmend-live";
  RequireReadableFile(options->camera, "camera file");
  const Camera camera = ReadCamera(options->camera);
  if (camera.width <= 0 || camera.height <= 0) {
    Fail("camera file " + options->camera + ": does not say width and height, which --live needs");
  }
  CheckAgainstImages(inputs, camera.width, camera.height);
}

// Positions of the vehicle: that they can be read, and a line about them.
void CheckPositions(RunInputs* inputs) {
  RunOptions& options = inputs->options;
  if (!options.gps.empty() && options.gps != "exif" && options.gps != "none")
    RequireReadableFile(options.gps, "positions");
  const std::vector<std::string> images = options.live ? std::vector<std::string>() : ImagesOf(options.inputs);
  const PositionSource source = PositionSource::Open(options.gps, options.gps_origin, options.inputs, images);
  if (options.gps.empty()) options.gps = source.Path();
  if (!source.Note().empty()) inputs->notes.push_back(source.Note());
  if (!options.groundtruth_origin.empty()) ParseGeodetic(options.groundtruth_origin, "--groundtruth-origin");
}

// The same for a file. Notes what was found beside it.
void CheckFileInput(RunInputs* inputs) {
  RunOptions& options = inputs->options;
  std::error_code error;
  if (options.inputs.empty())
    throw UsageError("no input: give a video file, a folder of images or a log of lcm-logger, or --live");
  for (const std::string& name : options.inputs) {
    if (!fs::exists(name, error)) Fail("input " + name + " does not exist");
  }
  const bool is_folder = fs::is_directory(options.inputs.front(), error);
  const std::vector<std::string> files = ExpandLogs(options.inputs);
  const bool is_log = AreLogs(files);
  if (!is_log && !options.image_channel.empty())
    throw UsageError("--image-channel needs --live, or a log of lcm-logger as INPUT");

  const fs::path input = fs::absolute(options.inputs.front()).lexically_normal();
  const fs::path stem = is_folder && input.filename().empty() ? input.parent_path().filename() : input.stem();
  if (options.out.empty()) options.out = "mapmend-" + stem.string();

  // camera.yaml and times.txt beside a video, or in the folder of images.
  Camera camera;
  const fs::path beside = is_folder ? input : input.parent_path();
  if (options.camera.empty()) {
    const fs::path path = beside / "camera.yaml";
    if (fs::exists(path, error)) {
      options.camera = path.string();
      inputs->notes.push_back("camera " + options.camera + " (found beside the input)");
    } else {
      camera = TakeCameraFromPhotos(is_log ? std::vector<std::string>() : files, inputs);
    }
  }
  if (inputs->guessed_camera.empty()) {
    RequireReadableFile(options.camera, "camera file");
    camera = ReadCamera(options.camera);
  }
  options.inputs = files;
  if (options.times.empty() && !is_log) {
    const TimesBeside found = FindTimesBeside(options.inputs);
    options.times = found.path;
    if (!found.path.empty()) inputs->notes.push_back("times " + found.path + " (found beside the input)");
    if (!found.note.empty()) inputs->notes.push_back(found.note);
  }

  if (!options.times.empty()) RequireReadableFile(options.times, "times file");
  SourceOptions source;
  source.inputs = options.inputs;
  source.open_other = LogOpener(options.image_channel);
  source.times_path = options.times;
  source.camera_fps = camera.fps;
  source.skip = ParseFrameRanges(options.skip_frames);
  source.every = options.every.value_or(1);
  source.start_s = options.start.value_or(0);
  source.end_s = options.end.value_or(source.end_s);
  if (source.start_s >= source.end_s) Fail("--start must be before --end");
  const ImageSource images(source);
  inputs->num_frames = images.FramesHint();
  for (const std::string& note : images.Notes()) inputs->notes.push_back(note);
  if (const auto [width, height] = images.UsualSize(); width > 0) CheckAgainstImages(inputs, width, height);
}

}  // namespace

void ApplyFollow(RunOptions* options) {
  if (!options->follow) return;
  if (options->live || options->realtime || options->inputs.size() != 1)
    throw UsageError("--follow needs one folder as INPUT, and does not go with --live or --realtime");
  options->source = options->inputs.front();
  options->inputs.clear();
  options->live = true;
}

RunInputs CheckRunInputs(const RunOptions& given) {
  RunInputs inputs;
  inputs.options = given;
  RunOptions& options = inputs.options;
  if (options.live)
    CheckLiveInput(&inputs);
  else
    CheckFileInput(&inputs);
  CheckPositions(&inputs);
  if (!options.live && !options.source.empty()) throw UsageError("--source needs --live");
  if (options.speed && !options.realtime) throw UsageError("--speed needs --realtime");
  if (options.max_waiting && !options.realtime && !options.live)
    throw UsageError("--max-waiting needs --realtime or --live");
  if (!options.groundtruth.empty()) {
    RequireReadableFile(options.groundtruth, "ground truth");
    const TrajectoryFile file = ReadGroundTruth(options.groundtruth, options.times, options.time_offset.value_or(0));
    if (!file.note.empty()) inputs.notes.push_back("ground truth " + file.note);
  } else if (options.time_offset || options.time_tolerance) {
    throw UsageError("--time-offset and --time-tolerance need --groundtruth");
  }
  if (options.features && *options.features < 100)
    Fail("--features " + std::to_string(*options.features) + ": at least 100");
  constexpr int kMinDimension = 64;  // pixels; below that no patch of a feature fits
  if (options.max_dimension && *options.max_dimension != 0 && *options.max_dimension < kMinDimension) {
    throw UsageError("--max-dimension " + std::to_string(*options.max_dimension) + ": at least " +
                     std::to_string(kMinDimension) + " pixels, or 0 for images as they are");
  }
  if (options.overwrite && options.append) throw UsageError("--overwrite and --append exclude each other");
  CheckVocabulary(&inputs);
  return inputs;
}

}  // namespace mapmend
