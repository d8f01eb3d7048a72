// `mapmend vocab recall`: how often a vocabulary finds the same place again, on a flight with ground truth.

#include <CLI/CLI.hpp>
#include <cstdio>
#include <map>
#include <memory>
#include <opencv2/core.hpp>
#include <opencv2/imgproc.hpp>
#include <opencv2/videoio.hpp>
#include <stdexcept>

#include "libs/features/orb_extractor.h"
#include "libs/geometry/times_file.h"
#include "libs/geometry/trajectory_file.h"
#include "libs/retrieval/recall.h"
#include "libs/retrieval/vocabulary.h"
#include "procs/mapmend/commands.h"
#include "procs/mapmend/paths.h"

namespace mapmend {
namespace {

struct Arguments {
  std::string video, times, groundtruth, vocabulary;
  int num_features = 1000;
  RecallOptions recall;
};

void Run(const Arguments& arguments) {
  const std::string path = arguments.vocabulary.empty() ? DefaultVocabulary() : arguments.vocabulary;
  if (path.empty()) throw std::runtime_error("no vocabulary found: give one with --vocabulary");
  const Vocabulary vocabulary = Vocabulary::Read(path);
  const Trajectory groundtruth = ReadTrajectory(arguments.groundtruth);
  cv::VideoCapture video(arguments.video);
  if (!video.isOpened()) throw std::runtime_error("cannot read video " + arguments.video);
  OrbOptions orb;
  orb.num_features = arguments.num_features;
  const OrbExtractor extractor(orb);

  const std::vector<int64_t> utimes = ReadFrameTimes(arguments.times).utimes;
  std::map<int64_t, Eigen::Vector3d> positions;
  for (const StampedPose& pose : groundtruth) positions[pose.utime] = pose.world_from_camera.translation;

  std::vector<RecallFrame> frames;
  cv::Mat image, grey;
  double num_words = 0;
  for (const int64_t utime : utimes) {
    if (!video.read(image))
      throw std::runtime_error(arguments.video + " has fewer frames than " + arguments.times + " lines");
    const auto position = positions.find(utime);
    if (position == positions.end()) continue;
    cv::cvtColor(image, grey, cv::COLOR_BGR2GRAY);
    frames.push_back({position->second, vocabulary.Transform(extractor.Extract(grey).descriptors).bow});
    num_words += frames.back().bow.Size();
  }
  if (frames.empty()) throw std::runtime_error("no time of " + arguments.times + " is in " + arguments.groundtruth);
  const RecallResult result = MeasureRecall(frames, arguments.recall);
  std::printf("%zu frames, %.0f words each; %d queries have another frame within %g m\n", frames.size(),
              num_words / static_cast<double>(frames.size()), result.num_queries, arguments.recall.radius);
  std::printf("recall@1 %.3f  @3 %.3f  @10 %.3f\n", result.recall_at_1, result.recall_at_3, result.recall_at_10);
}

}  // namespace

void AddVocabRecallCommand(CLI::App* vocab) {
  auto arguments = std::make_shared<Arguments>();
  CLI::App* recall = vocab->add_subcommand("recall", "Measure place recognition on a video with ground truth");
  recall->add_option("VIDEO", arguments->video, "Video file")->required();
  recall->add_option("--groundtruth", arguments->groundtruth, "TUM file of camera poses")->required();
  recall->add_option("--times", arguments->times, "Times of the frames in seconds, one line per frame")->required();
  recall->add_option("--vocabulary", arguments->vocabulary, "Vocabulary (default: the one that comes with mapmend)");
  recall->add_option("--features", arguments->num_features, "ORB features per frame")->capture_default_str();
  recall->add_option("--radius", arguments->recall.radius, "Camera distance that counts as the same place, metres")
      ->capture_default_str();
  recall
      ->add_option("--exclude", arguments->recall.excluded_frames,
                   "Frames before and after the query that are not searched")
      ->capture_default_str();
  recall->callback([arguments] { Run(*arguments); });
}

}  // namespace mapmend
