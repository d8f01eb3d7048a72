// The three ways of matching that mapmend uses, between two consecutive photos of the bundled flight (about 53 pixels
// of motion): everything with everything, by vocabulary node, and around a predicted pixel. "matches" tells how many
// each finds.

#include <benchmark/benchmark.h>

#include <algorithm>
#include <opencv2/core.hpp>
#include <opencv2/imgproc.hpp>
#include <opencv2/videoio.hpp>
#include <stdexcept>

#include "libs/features/matching.h"
#include "libs/features/orb_extractor.h"
#include "libs/retrieval/vocabulary.h"

namespace mapmend {
namespace {

constexpr int kFrame = 10;  // and the next one: the middle of a strip

struct ImagePair {
  Features a, b;
  FeatureGrid grid_b;
  Eigen::Vector2f motion;  // median over brute-force matches, pixels
};

float Median(std::vector<float> values) {
  std::nth_element(values.begin(), values.begin() + values.size() / 2, values.end());
  return values[values.size() / 2];
}

ImagePair MakePair(int num_features) {
  cv::VideoCapture video(MAPMEND_SOURCE_DIR "/data/flights/sheffield_cross/video.mp4");
  cv::Mat frame, grey[2];
  for (int i = 0; i <= kFrame + 1; ++i) {
    if (!video.read(frame)) throw std::runtime_error("the bundled flight cannot be read");
    if (i >= kFrame) cv::cvtColor(frame, grey[i - kFrame], cv::COLOR_BGR2GRAY);
  }
  OrbOptions options;
  options.num_features = num_features;
  const OrbExtractor extractor(options);
  ImagePair pair;
  for (int i = 0; i < 2; ++i) {
    RawFeatures raw = extractor.Extract(grey[i]);
    Features& features = i == 0 ? pair.a : pair.b;
    features.keypoints = std::move(raw.keypoints);
    features.descriptors = std::move(raw.descriptors);
  }
  pair.grid_b = FeatureGrid(pair.b.keypoints, grey[1].cols, grey[1].rows);
  std::vector<float> dx, dy;
  for (const Match& m : MatchBruteForce(pair.a, pair.b, {})) {
    dx.push_back(pair.b.keypoints[m.b].pixel.x() - pair.a.keypoints[m.a].pixel.x());
    dy.push_back(pair.b.keypoints[m.b].pixel.y() - pair.a.keypoints[m.a].pixel.y());
  }
  pair.motion = {Median(dx), Median(dy)};
  return pair;
}

void BruteForce(benchmark::State& state) {
  const ImagePair pair = MakePair(static_cast<int>(state.range(0)));
  size_t matches = 0;
  for (auto _ : state) matches = MatchBruteForce(pair.a, pair.b, {}).size();
  state.counters["matches"] = static_cast<double>(matches);
}

// Without the descent through the vocabulary, which every keyframe makes once.
void ByNodes(benchmark::State& state) {
  const ImagePair pair = MakePair(static_cast<int>(state.range(0)));
  const Vocabulary vocabulary = Vocabulary::Read(MAPMEND_SOURCE_DIR "/data/vocabulary/mapmend.voc");
  const BowTransform a = vocabulary.Transform(pair.a), b = vocabulary.Transform(pair.b);
  size_t matches = 0;
  for (auto _ : state) matches = MatchByNodes(pair.a, a.nodes, pair.b, b.nodes, {}).size();
  state.counters["matches"] = static_cast<double>(matches);
}

void WordsAndNodes(benchmark::State& state) {
  const ImagePair pair = MakePair(static_cast<int>(state.range(0)));
  const Vocabulary vocabulary = Vocabulary::Read(MAPMEND_SOURCE_DIR "/data/vocabulary/mapmend.voc");
  for (auto _ : state) benchmark::DoNotOptimize(vocabulary.Transform(pair.a));
}

// Every feature of a is looked for in b where the image's median motion puts it.
void AroundPrediction(benchmark::State& state) {
  const ImagePair pair = MakePair(static_cast<int>(state.range(0)));
  GuidedSearch search;
  search.radius = static_cast<float>(state.range(1));
  const std::vector<uint8_t> used(pair.b.Size(), 0);
  int matches = 0;
  for (auto _ : state) {
    matches = 0;
    for (int i = 0; i < static_cast<int>(pair.a.Size()); ++i) {
      const Keypoint& keypoint = pair.a.keypoints[i];
      search.min_octave = std::max(0, keypoint.octave - 1);
      search.max_octave = keypoint.octave + 1;
      matches +=
          FindNear(pair.b, pair.grid_b, keypoint.pixel + pair.motion, pair.a.descriptors[i], search, used).b >= 0;
    }
  }
  state.counters["matches"] = matches;
}

BENCHMARK(BruteForce)->Arg(1000)->Arg(2000)->Unit(benchmark::kMillisecond);
BENCHMARK(ByNodes)->Arg(1000)->Arg(2000)->Unit(benchmark::kMillisecond);
BENCHMARK(WordsAndNodes)->Arg(1000)->Arg(2000)->Unit(benchmark::kMillisecond);
BENCHMARK(AroundPrediction)
    ->ArgNames({"features", "radius"})
    ->ArgsProduct({{1000, 2000}, {15, 40}})
    ->Unit(benchmark::kMillisecond);

}  // namespace
}  // namespace mapmend

BENCHMARK_MAIN();
