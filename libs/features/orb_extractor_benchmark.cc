// Extraction beside OpenCV's ORB in one run, one thread, on real texture: a mosaic of frames of the bundled flight.

#include <benchmark/benchmark.h>

#include <opencv2/core.hpp>
#include <opencv2/features2d.hpp>
#include <opencv2/imgproc.hpp>
#include <opencv2/videoio.hpp>

#include "libs/features/orb_extractor.h"

namespace mapmend {
namespace {

// Frames 0, 20, 40, ... side by side, cropped to 640 x 540, until the size is filled; then cut.
cv::Mat Mosaic(int width, int height) {
  cv::VideoCapture video(MAPMEND_SOURCE_DIR "/data/flights/sheffield_cross/video.mp4");
  cv::Mat frame, grey, mosaic((height + 539) / 540 * 540, (width + 639) / 640 * 640, CV_8UC1, cv::Scalar(0));
  int index = 0;
  for (int y = 0; y < mosaic.rows; y += 540) {
    for (int x = 0; x < mosaic.cols; x += 640) {
      do video.read(frame);
      while (index++ % 20 != 0);
      cv::cvtColor(frame, grey, cv::COLOR_BGR2GRAY);
      grey(cv::Rect(80, 30, 640, 540)).copyTo(mosaic(cv::Rect(x, y, 640, 540)));
    }
  }
  return mosaic(cv::Rect(0, 0, width, height)).clone();
}

// Arguments: width, height, features.
void Mapmend(benchmark::State& state) {
  cv::setNumThreads(1);
  const cv::Mat image = Mosaic(static_cast<int>(state.range(0)), static_cast<int>(state.range(1)));
  OrbOptions options;
  options.num_features = static_cast<int>(state.range(2));
  const OrbExtractor extractor(options);
  int num_features = 0;
  for (auto _ : state) num_features = extractor.Extract(image).Size();
  state.counters["features"] = num_features;
}

void OpenCv(benchmark::State& state) {
  cv::setNumThreads(1);
  const cv::Mat image = Mosaic(static_cast<int>(state.range(0)), static_cast<int>(state.range(1)));
  const cv::Ptr<cv::ORB> orb = cv::ORB::create(static_cast<int>(state.range(2)), 1.2f, 8);
  std::vector<cv::KeyPoint> keypoints;
  cv::Mat descriptors;
  for (auto _ : state) orb->detectAndCompute(image, cv::noArray(), keypoints, descriptors);
  state.counters["features"] = static_cast<double>(keypoints.size());
}

void Sizes(benchmark::internal::Benchmark* benchmark) {
  benchmark->Args({1920, 1080, 2000})->Args({640, 480, 1000})->Unit(benchmark::kMillisecond)->MinTime(0.5);
}
BENCHMARK(Mapmend)->Apply(Sizes);
BENCHMARK(OpenCv)->Apply(Sizes);

}  // namespace
}  // namespace mapmend

BENCHMARK_MAIN();
