// Speed and size of the store, and how they grow with the number of keyframes. BoW vectors are drawn from real ones:
// the words of the bundled flight's images under the bundled vocabulary, mixed so that neighbouring keyframes look
// alike.
//   submap_store_benchmark --benchmark_filter=Query
// MAPMEND_LATENCY_SECONDS: length of the write latency runs at 30 keyframes a second (10).
// MAPMEND_BENCHMARK_FILES: folder in which filled files are kept for the next run, so that a large one need not be made
// again while nothing else may run. Without it files lie in $TMPDIR and are removed.

#include <benchmark/benchmark.h>
#include <fcntl.h>
#include <unistd.h>

#include <algorithm>
#include <chrono>
#include <cstdlib>
#include <filesystem>
#include <map>
#include <opencv2/imgproc.hpp>
#include <opencv2/videoio.hpp>
#include <random>
#include <thread>

#include "libs/features/orb_extractor.h"
#include "libs/retrieval/vocabulary.h"
#include "procs/submap_store/submap_store.h"

namespace mapmend {
namespace {

using Clock = std::chrono::steady_clock;

double MsSince(Clock::time_point start) {
  return std::chrono::duration<double, std::milli>(Clock::now() - start).count();
}

double Quantile(std::vector<double> values, double q) {
  std::sort(values.begin(), values.end());
  return values.empty() ? 0 : values[static_cast<size_t>(q * static_cast<double>(values.size() - 1))];
}

// BoW vectors of the images of the bundled flight.
const std::vector<BowVector>& RealVectors() {
  static const std::vector<BowVector> vectors = [] {
    const std::string data = std::string(MAPMEND_SOURCE_DIR) + "/data/";
    const Vocabulary vocabulary = Vocabulary::Read(data + "vocabulary/mapmend.voc");
    const OrbExtractor extractor((OrbOptions()));
    cv::VideoCapture video(data + "flights/sheffield_cross/video.mp4");
    std::vector<BowVector> result;
    cv::Mat image, grey;
    while (video.read(image)) {
      cv::cvtColor(image, grey, cv::COLOR_BGR2GRAY);
      Features features;
      RawFeatures raw = extractor.Extract(grey);
      features.keypoints = std::move(raw.keypoints);
      features.descriptors = std::move(raw.descriptors);
      result.push_back(vocabulary.Transform(features).bow);
    }
    if (result.empty()) throw std::runtime_error("cannot read the bundled flight");
    return result;
  }();
  return vectors;
}

// Three quarters of one image's words and as many from other images as are missing: keyframe i stands at image i / 5.
BowVector DrawVector(int i, std::mt19937* random) {
  const std::vector<BowVector>& real = RealVectors();
  const BowVector& base = real[static_cast<size_t>(i / 5) % real.size()];
  std::map<int32_t, float> words;
  for (int k = 0; k < base.Size(); ++k) {
    if ((*random)() % 4 != 0) words[base.words[static_cast<size_t>(k)]] = base.weights[static_cast<size_t>(k)];
  }
  while (static_cast<int>(words.size()) < base.Size()) {
    const BowVector& other = real[(*random)() % real.size()];
    const size_t k = (*random)() % other.words.size();
    words[other.words[k]] = other.weights[k];
  }
  BowVector bow;
  float sum = 0;
  for (const auto& [word, weight] : words) sum += weight;
  for (const auto& [word, weight] : words) {
    bow.words.push_back(word);
    bow.weights.push_back(weight / sum);
  }
  return bow;
}

constexpr int kSubmapSize = 300;

// Records of one keyframe of a flight as the frontend makes them: new points, the keyframe, what local bundle
// adjustment moved.
class FlightMaker {
 public:
  FlightMaker(SubmapStore* store, int num_features) : store_(store), num_features_(num_features) {}

  void Start() {
    SessionStarted start;
    start.pinhole = {500, 500, 320, 240, 640, 480};
    start.camera.fx = start.camera.fy = 500;
    start.vocabulary_hash = "benchmark";
    Offer(start);
    store_->CommitReady(0);
  }
  // Returns the milliseconds that the commit took.
  double AddKeyframe(bool commit = true) {
    if (keyframe_ % kSubmapSize == 0) {
      if (keyframe_ > 0) Offer(SubmapEnded{submap_, "too_few_matches", "", keyframe_, 0});
      submap_ = SubmapId(keyframe_ / kSubmapSize);
      Offer(SubmapStarted{submap_});
      first_point_ = next_point_;
    }
    const int num_points = num_features_ / 2, num_new = num_features_ / 10;
    MapUpdate points;
    points.submap = submap_;
    const int count = next_point_ == first_point_ ? num_points : num_new;
    for (int i = 0; i < count; ++i) points.points.push_back({MapPointId(next_point_++), RandomPoint()});
    KeyframeRecord keyframe = MakeKeyframe(num_points);
    MapUpdate moved;
    moved.submap = submap_;
    for (int i = 0; i < num_points * 3; ++i) {
      const int point = next_point_ - 1 - i;
      if (point >= first_point_) moved.points.push_back({MapPointId(point), RandomPoint()});
    }
    moved.keyframes.push_back({KeyframeId(keyframe_), {}});
    for (int i = 0; i < num_new; ++i) {
      moved.observations.push_back({KeyframeId(keyframe_), num_points + i, MapPointId(next_point_ - 1 - i)});
    }
    for (int i = 0; i < 3; ++i) moved.frames.push_back({keyframe_ * 3 + i, keyframe_, KeyframeId(keyframe_), {}});
    Offer(std::move(points));
    Offer(std::move(keyframe));
    Offer(std::move(moved));
    ++keyframe_;
    if (!commit) return 0;
    const auto start = Clock::now();
    store_->CommitReady(0);
    return MsSince(start);
  }
  void End() {
    Offer(SubmapEnded{submap_, "end_of_input", "", keyframe_, 0});
    Offer(SessionEnded{keyframe_});
    store_->CommitReady(0);
    while (store_->WorkInBackground()) continue;
  }
  void SetNumFeatures(int num_features) { num_features_ = num_features; }

 private:
  Eigen::Vector3f RandomPoint() {
    return {static_cast<float>(random_() % 10000), static_cast<float>(random_() % 10000),
            static_cast<float>(random_() % 10000)};
  }
  KeyframeRecord MakeKeyframe(int num_points) {
    KeyframeRecord record;
    record.submap = submap_;
    record.keyframe = KeyframeId(keyframe_);
    record.frame = keyframe_ * 3;
    record.bow = DrawVector(keyframe_, &random_);
    for (int i = 0; i < num_features_; ++i) {
      record.features.keypoints.push_back(
          {{static_cast<float>(random_() % 6400) / 10, static_cast<float>(random_() % 4800) / 10}, 1, 2});
      Descriptor descriptor;
      for (uint64_t& word : descriptor) word = static_cast<uint64_t>(random_()) << 32 | random_();
      record.features.descriptors.push_back(descriptor);
      record.features.colors.push_back({1, 2, 3});
      const int point = next_point_ - 1 - i;
      record.map_points.push_back(i < num_points && point >= first_point_ ? MapPointId(point) : MapPointId());
      record.words.push_back(i);
      record.nodes.push_back(i);
    }
    return record;
  }
  void Offer(RecordBody body) {
    const EncodedRecord encoded = EncodeRecord({{kSession, seq_++, 0}, std::move(body)});
    store_->OnRecord(encoded.channel, encoded.data.data(), static_cast<int>(encoded.data.size()), 0);
  }

  static constexpr const char* kSession = "benchmark";
  SubmapStore* store_;
  int num_features_;
  std::mt19937 random_{1};
  int64_t seq_ = 0;
  int32_t keyframe_ = 0, next_point_ = 0, first_point_ = 0;
  SubmapId submap_;
};

constexpr int kFeatures = 1000;

// A file of n keyframes. Of a hundred thousand, only the last submap, which is asked about, has keyframes of 1000
// features; the others have few, since queries and opening do not read them.
struct FilledStore {
  explicit FilledStore(int n) : num_keyframes(n) {
    const char* folder = std::getenv("MAPMEND_BENCHMARK_FILES");
    keep = folder != nullptr;
    const std::filesystem::path parent = keep ? std::filesystem::path(folder) : std::filesystem::temp_directory_path();
    path = parent / ("mapmend-benchmark-" + (keep ? "" : std::to_string(getpid()) + "-") + std::to_string(n) + ".db");
    if (!std::filesystem::exists(path)) Fill();
    Open();
    last_seq = store->Fetch(FetchRequest{}).sessions.at(0).seq;
  }
  ~FilledStore() {
    store.reset();
    if (keep) return;
    for (const char* suffix : {"", "-wal", "-shm"}) std::filesystem::remove(path.string() + suffix);
  }
  void Fill() {
    const std::string unfinished = path.string() + ".unfinished";
    std::filesystem::remove(unfinished);
    {
      SubmapStoreOptions options;
      options.path = unfinished;
      SubmapStore filling(options);
      FlightMaker flight(&filling, num_keyframes > 20000 ? 60 : kFeatures);
      flight.Start();
      for (int i = 0; i < num_keyframes; ++i) {
        if (i == num_keyframes / kSubmapSize * kSubmapSize) flight.SetNumFeatures(kFeatures);
        flight.AddKeyframe(i % 64 == 63);
        while (filling.WorkInBackground()) continue;
      }
      flight.End();
    }
    std::filesystem::rename(unfinished, path);
  }
  void Open() {
    SubmapStoreOptions options;
    options.path = path;
    store = std::make_unique<SubmapStore>(options);
    while (store->WorkInBackground()) continue;  // nothing to do, unless the file is of an older schema
  }
  std::filesystem::path path;
  std::unique_ptr<SubmapStore> store;
  int64_t last_seq = 0;
  int num_keyframes = 0;
  bool keep = false;
};

FilledStore& Filled(int n) {
  static std::map<int, std::unique_ptr<FilledStore>> stores;
  auto& store = stores[n];
  if (!store) store = std::make_unique<FilledStore>(n);
  return *store;
}

// Makes the kernel forget what it has of a file, so that it is read from the disk.
void DropFromCache(const std::filesystem::path& path) {
  const int fd = open(path.c_str(), O_RDONLY | O_CLOEXEC);
  if (fd < 0) return;
  fdatasync(fd);
  posix_fadvise(fd, 0, 0, POSIX_FADV_DONTNEED);
  close(fd);
}

// An index of n keyframes and no file.
InvertedIndex& FilledIndex(int n) {
  static std::map<int, InvertedIndex> indexes;
  InvertedIndex& index = indexes[n];
  std::mt19937 random(1);
  for (int i = index.Size(); i < n; ++i) index.Add(DrawVector(i, &random), {0, i / kSubmapSize, i, i});
  return index;
}

// Index alone: one keyframe in, at n keyframes.
void BM_InsertInMemory(benchmark::State& state) {
  const auto n = static_cast<int>(state.range(0));
  InvertedIndex& index = FilledIndex(n);
  state.counters["index_bytes_per_keyframe"] = static_cast<double>(index.Bytes()) / index.Size();
  std::mt19937 random(2);
  std::vector<BowVector> more;
  for (int i = 0; i < 1000; ++i) more.push_back(DrawVector(n + i, &random));
  size_t i = 0;
  for (auto _ : state) {
    const int at = index.Size();
    index.Add(more[i++ % more.size()], {0, at / kSubmapSize, at, at});
  }
}

// Index alone: keyframes with enough common words, at n keyframes.
void BM_IndexQuery(benchmark::State& state) {
  const auto n = static_cast<int>(state.range(0));
  const InvertedIndex& index = FilledIndex(n);
  std::mt19937 random(3);
  std::vector<BowVector> queries;
  for (int i = 0; i < 100; ++i) queries.push_back(DrawVector(i * 7, &random));
  IndexScope scope;
  scope.last_seq = {1 << 30};
  std::vector<double> times;
  for (auto _ : state) {
    const auto start = Clock::now();
    benchmark::DoNotOptimize(index.Query(queries[times.size() % queries.size()], scope, 0.8));
    times.push_back(MsSince(start));
  }
  state.counters["median_ms"] = Quantile(times, 0.5);
}

// A whole query of the store: thresholds, index, covisible groups, at n keyframes.
void BM_Query(benchmark::State& state) {
  FilledStore& filled = Filled(static_cast<int>(state.range(0)));
  BowQuery query;
  query.requester = "benchmark";
  query.session = "benchmark";
  query.cursors = {{"benchmark", filled.last_seq}};
  query.keyframe = KeyframeId(filled.num_keyframes - 250);
  filled.store->Query(query);  // reads its submap
  std::vector<double> times;
  int num_candidates = 0;
  for (auto _ : state) {
    query.keyframe = KeyframeId(filled.num_keyframes - 250 + static_cast<int>(times.size()) % 240);
    const auto start = Clock::now();
    num_candidates += static_cast<int>(filled.store->Query(query).proposals.size());
    times.push_back(MsSince(start));
  }
  state.counters["median_ms"] = Quantile(times, 0.5);
  state.counters["p99_ms"] = Quantile(times, 0.99);
  state.counters["candidates"] = num_candidates / static_cast<double>(times.size());
}

// Opening a file that was closed properly: first from the disk, then once more from the kernel's cache.
void BM_Reopen(benchmark::State& state) {
  FilledStore& filled = Filled(static_cast<int>(state.range(0)));
  for (auto _ : state) {
    filled.store.reset();
    DropFromCache(filled.path);
    auto start = Clock::now();
    filled.Open();
    state.counters["cold_ms"] = MsSince(start);
    filled.store.reset();
    start = Clock::now();
    filled.Open();
    const double warm = MsSince(start);
    state.counters["warm_ms"] = warm;
    state.SetIterationTime(1e-3 * warm);
  }
  state.counters["memory_bytes_per_keyframe"] =
      static_cast<double>(filled.store->GetStatus(0).bytes_in_memory) / filled.num_keyframes;
}

// Keyframes of 1000 features, three records each, one commit (synchronous FULL) per keyframe; and what the file takes.
void BM_InsertWithCommit(benchmark::State& state) {
  const auto n = static_cast<int>(state.range(0));
  const auto path = std::filesystem::temp_directory_path() / ("mapmend-benchmark-" + std::to_string(getpid()) + ".db");
  for (auto _ : state) {
    SubmapStoreOptions options;
    options.path = path;
    std::vector<double> times;
    {
      SubmapStore store(options);
      FlightMaker flight(&store, kFeatures);
      flight.Start();
      for (int i = 0; i < n; ++i) {
        times.push_back(flight.AddKeyframe());
        store.WorkInBackground();
      }
      flight.End();
    }
    state.counters["commit_median_ms"] = Quantile(times, 0.5);
    state.counters["commit_p99_ms"] = Quantile(times, 0.99);
    state.counters["file_bytes_per_keyframe"] = static_cast<double>(std::filesystem::file_size(path)) / n;
    std::filesystem::remove(path);
  }
}

int LatencySeconds() {
  const char* setting = std::getenv("MAPMEND_LATENCY_SECONDS");
  return setting == nullptr ? 10 : std::atoi(setting);
}

// What the disk itself allows: the bytes of a keyframe written over an old file and made durable, 30 times a second.
void BM_DiskLatency(benchmark::State& state) {
  const std::string path = std::filesystem::temp_directory_path() / ("mapmend-disk-" + std::to_string(getpid()));
  const int fd = open(path.c_str(), O_RDWR | O_CREAT | O_TRUNC | O_CLOEXEC, 0600);
  const std::vector<char> bytes(120000, 'x');
  constexpr int kSlots = 64;
  for (auto _ : state) {
    std::vector<double> times;
    bool is_good = fd >= 0;
    for (int i = 0; i < kSlots; ++i) is_good &= write(fd, bytes.data(), bytes.size()) > 0;
    is_good &= fsync(fd) == 0;
    const auto start = Clock::now();
    for (int i = 0; i < LatencySeconds() * 30; ++i) {
      std::this_thread::sleep_until(start + std::chrono::microseconds(33333) * i);
      const auto at = Clock::now();
      is_good &= pwrite(fd, bytes.data(), bytes.size(), static_cast<off_t>(i % kSlots * bytes.size())) > 0;
      is_good &= fdatasync(fd) == 0;
      times.push_back(MsSince(at));
    }
    if (!is_good) state.SkipWithError("cannot write");
    state.counters["median_ms"] = Quantile(times, 0.5);
    state.counters["p99_ms"] = Quantile(times, 0.99);
    state.counters["max_ms"] = Quantile(times, 1.0);
  }
  close(fd);
  std::filesystem::remove(path);
}

// 30 keyframes of 1000 features a second, as a flight brings them.
void BM_WriteLatency(benchmark::State& state) {
  const int seconds = LatencySeconds();
  const auto path = std::filesystem::temp_directory_path() / ("mapmend-latency-" + std::to_string(getpid()) + ".db");
  for (auto _ : state) {
    SubmapStoreOptions options;
    options.path = path;
    SubmapStore store(options);
    FlightMaker flight(&store, kFeatures);
    flight.Start();
    std::vector<double> times;
    const auto start = Clock::now();
    int64_t largest_wal = 0;
    for (int i = 0; i < seconds * 30; ++i) {
      while (Clock::now() < start + std::chrono::microseconds(33333) * i) {
        if (!store.WorkInBackground()) std::this_thread::sleep_for(std::chrono::milliseconds(1));
      }
      times.push_back(flight.AddKeyframe());
      std::error_code ignored;
      largest_wal = std::max<int64_t>(
          largest_wal, static_cast<int64_t>(std::filesystem::file_size(path.string() + "-wal", ignored)));
    }
    state.counters["median_ms"] = Quantile(times, 0.5);
    state.counters["p99_ms"] = Quantile(times, 0.99);
    state.counters["max_ms"] = Quantile(times, 1.0);
    state.counters["wal_mb"] = static_cast<double>(largest_wal) / (1 << 20);
  }
  for (const char* suffix : {"", "-wal", "-shm"}) std::filesystem::remove(path.string() + suffix);
}

BENCHMARK(BM_InsertInMemory)->Arg(1000)->Arg(10000)->Arg(100000)->Iterations(1000)->Unit(benchmark::kMicrosecond);
BENCHMARK(BM_IndexQuery)->Arg(1000)->Arg(10000)->Arg(100000)->Iterations(200)->Unit(benchmark::kMillisecond);
BENCHMARK(BM_Query)->Arg(1000)->Arg(10000)->Arg(100000)->Iterations(480)->Unit(benchmark::kMillisecond);
BENCHMARK(BM_Reopen)->Arg(1000)->Arg(10000)->Arg(100000)->Iterations(1)->UseManualTime()->Unit(benchmark::kMillisecond);
BENCHMARK(BM_InsertWithCommit)->Arg(1000)->Arg(10000)->Arg(100000)->Iterations(1)->Unit(benchmark::kMillisecond);
BENCHMARK(BM_DiskLatency)->Iterations(1)->Unit(benchmark::kMillisecond);
BENCHMARK(BM_WriteLatency)->Iterations(1)->Unit(benchmark::kMillisecond);

}  // namespace
}  // namespace mapmend

BENCHMARK_MAIN();
