// Cost of the index over synthetic keyframes drawn from the BoW vectors of the bundled flight: each takes about six
// tenths of its words from one real frame and the rest from the words of all frames. One flight's words are few, so the
// lists of the index are longer than those of many flights over different ground would be.

#include <benchmark/benchmark.h>

#include <algorithm>
#include <cstdio>
#include <map>
#include <memory>
#include <opencv2/core.hpp>
#include <opencv2/imgproc.hpp>
#include <opencv2/videoio.hpp>

#include "libs/base/random.h"
#include "libs/features/orb_extractor.h"
#include "libs/retrieval/adaptive_thresholds.h"
#include "libs/retrieval/inverted_index.h"
#include "libs/retrieval/vocabulary.h"

namespace mapmend {
namespace {

struct RealWords {
  std::vector<std::vector<int32_t>> frames;
  std::vector<int32_t> all;
  std::map<int32_t, float> idf;  // of a word, up to a common factor
};

const RealWords& Real() {
  static const RealWords real = [] {
    RealWords r;
    const Vocabulary vocabulary = Vocabulary::Read(MAPMEND_SOURCE_DIR "/data/vocabulary/mapmend.voc");
    cv::VideoCapture video(MAPMEND_SOURCE_DIR "/data/flights/sheffield_cross/video.mp4");
    const OrbExtractor extractor(OrbOptions{});
    cv::Mat image, grey;
    while (video.read(image)) {
      cv::cvtColor(image, grey, cv::COLOR_BGR2GRAY);
      const BowVector bow = vocabulary.Transform(extractor.Extract(grey).descriptors).bow;
      r.frames.push_back(bow.words);
      r.all.insert(r.all.end(), bow.words.begin(), bow.words.end());
      for (int i = 0; i < bow.Size(); ++i) r.idf[bow.words[i]] = bow.weights[i];
    }
    std::printf("%zu frames, %.0f words each\n", r.frames.size(), double(r.all.size()) / double(r.frames.size()));
    return r;
  }();
  return real;
}

BowVector Synthetic(Random* random) {
  const RealWords& real = Real();
  const std::vector<int32_t>& base = real.frames[random->Below(static_cast<int>(real.frames.size()))];
  BowVector bow;
  for (const int32_t word : base) {
    bow.words.push_back(random->Uniform() < 0.6 ? word : real.all[random->Below(static_cast<int>(real.all.size()))]);
  }
  std::sort(bow.words.begin(), bow.words.end());
  bow.words.erase(std::unique(bow.words.begin(), bow.words.end()), bow.words.end());
  float sum = 0;
  for (const int32_t word : bow.words) bow.weights.push_back(real.idf.at(word)), sum += bow.weights.back();
  for (float& weight : bow.weights) weight /= sum;
  return bow;
}

const InvertedIndex& Index(int num_keyframes) {
  static std::map<int, std::unique_ptr<InvertedIndex>> made;
  auto& index = made[num_keyframes];
  if (!index) {
    index = std::make_unique<InvertedIndex>();
    Random random(1);
    for (int i = 0; i < num_keyframes; ++i) index->Add(Synthetic(&random), {0, i / 100, i, i});
  }
  return *index;
}

void Query(benchmark::State& state) {
  const int num_keyframes = static_cast<int>(state.range(0));
  const InvertedIndex& index = Index(num_keyframes);
  Random random(2);
  std::vector<BowVector> queries;
  for (int i = 0; i < 16; ++i) queries.push_back(Synthetic(&random));
  const IndexScope scope = {.last_seq = {num_keyframes}, .excluded_session = 0, .excluded_submap = 3};
  const auto covisible = [&](int32_t handle) {
    std::vector<int32_t> neighbors;
    for (int32_t h = std::max(0, handle - 5); h <= std::min(num_keyframes - 1, handle + 5); ++h) neighbors.push_back(h);
    return neighbors;
  };
  size_t i = 0;
  for (auto _ : state) {
    const BowVector& query = queries[i++ % queries.size()];
    const AdaptiveThresholds thresholds;
    const std::vector<IndexHit> hits = index.Query(query, scope, thresholds.k);
    benchmark::DoNotOptimize(SelectCandidates(hits, query.Size(), thresholds, covisible, {}));
  }
  state.counters["bytes_per_keyframe"] = static_cast<double>(index.Bytes()) / num_keyframes;
}
BENCHMARK(Query)->Arg(1000)->Arg(10000)->Arg(100000)->Unit(benchmark::kMillisecond)->MinTime(0.3);

void Insert(benchmark::State& state) {
  const int num_keyframes = static_cast<int>(state.range(0));
  InvertedIndex index;
  Random random(1);
  for (int i = 0; i < num_keyframes; ++i) index.Add(Synthetic(&random), {0, 0, i, i});
  std::vector<BowVector> added;
  for (int i = 0; i < 500; ++i) added.push_back(Synthetic(&random));
  size_t i = 0;
  for (auto _ : state) index.Add(added[i++ % added.size()], {0, 0, index.Size(), index.Size()});
}
BENCHMARK(Insert)->Arg(1000)->Arg(10000)->Iterations(2000)->Unit(benchmark::kMillisecond);

}  // namespace
}  // namespace mapmend

BENCHMARK_MAIN();
