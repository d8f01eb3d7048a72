#pragma once

#include <algorithm>
#include <cmath>
#include <random>
#include <set>
#include <string>
#include <vector>

#include "libs/stream/records.h"

// A stream of records as a frontend makes them, of any size, without images: a camera that flies over random points and
// words. Neighbouring keyframes share most points and words; a later submap that `revisits` an earlier one shares words
// with it.
namespace mapmend {

struct SyntheticStreamOptions {
  std::string session = "00000000-0000-4000-8000-000000000001";
  std::string vocabulary_hash = "feedc0de";
  int num_submaps = 2;
  int keyframes_per_submap = 10;
  int num_features = 100;
  int points_per_keyframe = 40;  // observed by features 0 ..
  int num_words = 80;            // of a keyframe
  int vocabulary_words = 100000;
  bool end_session = true;
  int64_t start_utime = 1700000000000000;
  unsigned seed = 1;
};

// Makes the records one by one, so that long flights need no memory.
class SyntheticStream {
 public:
  explicit SyntheticStream(const SyntheticStreamOptions& options) : options_(options), random_(options.seed) {}

  // The next body, or false at the end. utime is that of the measurement.
  bool Next(int64_t* utime, RecordBody* body) {
    const int per_submap = 2 + 3 * options_.keyframes_per_submap;
    *utime = options_.start_utime + 33333 * step_;
    if (step_ == 0) {
      *body = MakeStart();
    } else if (step_ <= static_cast<int64_t>(per_submap) * options_.num_submaps) {
      const auto at = static_cast<int>(step_ - 1);
      MakeInSubmap(SubmapId(at / per_submap), at % per_submap, *utime, body);
    } else if (options_.end_session && step_ == static_cast<int64_t>(per_submap) * options_.num_submaps + 1) {
      *body = SessionEnded{frame_};
    } else {
      return false;
    }
    ++step_;
    return true;
  }

 private:
  uint32_t Random() { return static_cast<uint32_t>(random_()); }

  SessionStarted MakeStart() {
    SessionStarted start;
    start.version = "test";
    start.vehicle = "kestrel";
    start.source = "synthetic";
    start.pinhole = {500, 500, 320, 240, 640, 480};
    start.camera.width = 640;
    start.camera.height = 480;
    start.camera.fx = start.camera.fy = 500;
    start.camera.cx = 320;
    start.camera.cy = 240;
    start.vocabulary_hash = options_.vocabulary_hash;
    start.settings_json = "{}";
    return start;
  }

  // Per keyframe: an update with the new points, the keyframe, an update that moves it and adds tracked frames.
  void MakeInSubmap(SubmapId submap, int at, int64_t utime, RecordBody* body) {
    if (at == 0) {
      *body = SubmapStarted{submap};
      base_point_ = next_point_;
      return;
    }
    const int in_submap = (at - 1) / 3;
    if (in_submap == options_.keyframes_per_submap) {
      *body = SubmapEnded{submap, "too_few_matches", "3 of 20 matches", frame_ - 1, utime};
      return;
    }
    switch ((at - 1) % 3) {
      case 0:
        *body = MakeNewPoints(submap);
        break;
      case 1:
        *body = MakeKeyframe(submap, in_submap);
        break;
      default:
        *body = MakeChange(submap, utime);
    }
  }

  Rigid3 Pose(double x) const {
    return {Eigen::Quaterniond(std::cos(0.01 * x), 0, 0, std::sin(0.01 * x)), Eigen::Vector3d(-x, 0.1 * x, 1)};
  }

  MapUpdate MakeNewPoints(SubmapId submap) {
    MapUpdate update;
    update.submap = submap;
    const int num_new = next_point_ == base_point_ ? options_.points_per_keyframe : options_.points_per_keyframe / 5;
    for (int i = 0; i < num_new; ++i) {
      const auto coordinate = [&] { return static_cast<float>(Random() % 2000) * 0.01f - 10.f; };
      update.points.push_back({MapPointId(next_point_++), {coordinate(), coordinate(), coordinate() + 30.f}});
    }
    return update;
  }

  KeyframeRecord MakeKeyframe(SubmapId submap, int in_submap) {
    KeyframeRecord record;
    record.submap = submap;
    record.keyframe = KeyframeId(++keyframe_);
    record.frame = frame_++;
    record.cam_from_submap = Pose(in_submap);
    const int n = options_.num_features;
    for (int i = 0; i < n; ++i) {
      record.features.keypoints.push_back(
          {{static_cast<float>(Random() % 6400) * 0.1f, static_cast<float>(Random() % 4800) * 0.1f},
           static_cast<float>(Random() % 628) * 0.01f,
           static_cast<int8_t>(Random() % 8)});
      Descriptor descriptor;
      for (uint64_t& word : descriptor) word = static_cast<uint64_t>(Random()) << 32 | Random();
      record.features.descriptors.push_back(descriptor);
      record.features.colors.push_back({static_cast<uint8_t>(Random()), 1, 2});
      // The newest points, so that keyframe k shares the more with k - j the smaller j is.
      const int point = next_point_ - 1 - i;
      record.map_points.push_back(i < options_.points_per_keyframe && point >= base_point_ ? MapPointId(point)
                                                                                           : MapPointId());
      record.words.push_back(static_cast<int32_t>(Random() % static_cast<uint32_t>(options_.vocabulary_words)));
      record.nodes.push_back(record.words.back() / 100);
    }
    // Words: a window that slides with the place, the same places in every submap.
    std::set<int32_t> words;
    for (int i = 0; i < options_.num_words; ++i) {
      const uint32_t place =
          static_cast<uint32_t>(in_submap) * static_cast<uint32_t>(options_.num_words) / 5 + static_cast<uint32_t>(i);
      const uint32_t word = place * 2654435761u % static_cast<uint32_t>(options_.vocabulary_words);
      words.insert(Random() % 10 == 0
                       ? static_cast<int32_t>(Random() % static_cast<uint32_t>(options_.vocabulary_words))
                       : static_cast<int32_t>(word));
    }
    for (const int32_t word : words) {
      record.bow.words.push_back(word);
      record.bow.weights.push_back(1.f / static_cast<float>(words.size()));
    }
    return record;
  }

  MapUpdate MakeChange(SubmapId submap, int64_t utime) {
    MapUpdate update;
    update.submap = submap;
    update.keyframes.push_back({KeyframeId(keyframe_), Pose(0.001 * (Random() % 1000))});
    update.points.push_back({MapPointId(next_point_ - 1), {1.f, 2.f, static_cast<float>(Random() % 100)}});
    if (options_.num_features > options_.points_per_keyframe) {
      update.observations.push_back({KeyframeId(keyframe_), options_.points_per_keyframe, MapPointId(next_point_ - 1)});
    }
    for (int i = 0; i < 3; ++i) update.frames.push_back({frame_++, utime + i, KeyframeId(keyframe_), Pose(0.1 * i)});
    return update;
  }

  SyntheticStreamOptions options_;
  std::mt19937 random_;
  int64_t step_ = 0;
  int32_t next_point_ = 0, base_point_ = 0, keyframe_ = -1;
  int frame_ = 0;
};

inline std::vector<Record> MakeSyntheticStream(const SyntheticStreamOptions& options) {
  SyntheticStream stream(options);
  std::vector<Record> records;
  Record record;
  while (stream.Next(&record.header.utime, &record.body)) {
    record.header.session = options.session;
    record.header.seq = static_cast<int64_t>(records.size());
    records.push_back(record);
  }
  return records;
}

}  // namespace mapmend
