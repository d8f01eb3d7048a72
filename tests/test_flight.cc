#include "tests/test_flight.h"

#include <gtest/gtest.h>

#include <cmath>

namespace mapmend {
namespace {

constexpr int kPointsPerSubmap = 12;
constexpr Pinhole kPinhole = {400, 400, 320, 240, 640, 480};

}  // namespace

TestFlight::TestFlight(const TestFlightOptions& options) : options_(options) {
  SessionStarted start;
  start.version = "test";
  start.vehicle = "uav";
  start.source = "flight.mp4";
  start.pinhole = kPinhole;
  start.settings_json = "{}";
  Add(Utime(0), start);
  for (int i = 0; i < options_.num_submaps; ++i) AddSubmap(i);
  Add(Utime(FirstFrame(options_.num_submaps)), SessionEnded{FirstFrame(options_.num_submaps)});
}

void TestFlight::Add(int64_t utime, RecordBody body) {
  records_.push_back({{options_.session, static_cast<int64_t>(records_.size()), utime}, std::move(body)});
}

Rigid3 TestFlight::WorldFromCamera(int frame) const {
  // Strips of 30 frames along x, 20 m apart, there and back.
  const int strip = frame / 30, along = frame % 30;
  const double x = 5.0 * (strip % 2 == 0 ? along : 29 - along), y = 20.0 * strip;
  const Eigen::Quaterniond down(Eigen::AngleAxisd(M_PI, Eigen::Vector3d::UnitX()));
  return {down, Eigen::Vector3d(x, y, 50 + std::sin(0.3 * frame))};
}

Similarity3 TestFlight::WorldFromSubmap(int submap) const {
  const Rigid3 start = WorldFromCamera(FirstFrame(submap));
  return {10.0 / (submap + 1), start.rotation, start.translation};
}

void TestFlight::AddSubmap(int submap) {
  const SubmapId id(submap);
  const Similarity3 world_from_submap = WorldFromSubmap(submap);
  const auto cam_from_submap = [&](int frame) {
    const Rigid3 cam_from_world = WorldFromCamera(frame).Inverse();
    return TransformWorld(cam_from_world, world_from_submap.Inverse());
  };
  const int first = FirstFrame(submap);
  Add(Utime(first), SubmapStarted{id});

  MapUpdate points;
  points.submap = id;
  points_.emplace_back();
  const int first_point = next_point_;
  for (int i = 0; i < kPointsPerSubmap; ++i) {
    const Eigen::Vector3d ground(10.0 * (i % 4) + 3 * submap, 10.0 * (i / 4), 0);
    points_.back().push_back(ground);
    points.points.push_back({MapPointId(next_point_++), (world_from_submap.Inverse() * ground).cast<float>()});
  }
  Add(Utime(first), points);

  KeyframeId reference;
  int reference_frame = first;
  for (int k = 0; k < options_.frames_per_submap; ++k) {
    const int frame = first + k;
    if (k % options_.keyframe_every == 0) {
      KeyframeRecord record;
      record.submap = id;
      record.keyframe = reference = KeyframeId(next_keyframe_++);
      record.frame = reference_frame = frame;
      record.cam_from_submap = cam_from_submap(frame);
      for (int i = 0; i < kPointsPerSubmap; ++i) {
        const Eigen::Vector3d in_camera = WorldFromCamera(frame).Inverse() * points_.back()[i];
        record.features.keypoints.push_back({kPinhole.Project(in_camera).cast<float>(), 0, 0});
        record.features.descriptors.push_back({});
        record.features.colors.push_back({static_cast<uint8_t>(10 * i), static_cast<uint8_t>(submap), 200});
        record.map_points.emplace_back(first_point + i);
        record.words.push_back(-1);
        record.nodes.push_back(-1);
      }
      Add(Utime(frame), record);
    }
    MapUpdate update;
    update.submap = id;
    update.frames.push_back(
        {frame, Utime(frame), reference, cam_from_submap(frame) * cam_from_submap(reference_frame).Inverse()});
    Add(Utime(frame), update);
  }
  const int last = first + options_.frames_per_submap - 1;
  const bool lost = submap + 1 < options_.num_submaps || options_.last_ends_with_loss;
  Add(Utime(last), SubmapEnded{id, lost ? "too_few_matches" : "end_of_input",
                               lost ? "5 frames in a row had fewer than 20 matches" : "", last, Utime(last)});
}

MapRevision TestFlight::Revision() const {
  using Verdict = EvaluatedConnection::Verdict;
  MapRevision map;
  map.transforms.revision = 3;
  map.transforms.is_final = true;
  const Similarity3 root_from_world = WorldFromSubmap(0).Inverse();
  for (int i = 0; i < options_.num_submaps; ++i) {
    map.transforms.submaps.push_back({Key(i), 0, root_from_world * WorldFromSubmap(i), i == 0});
  }
  for (int a = 0; a < options_.num_submaps; ++a) {
    for (int b = a + 1; b < std::min(options_.num_submaps, a + 4); ++b) {
      EvaluatedConnection c;
      c.a = Key(a);
      c.b = Key(b);
      c.verdict = b == a + 3 ? Verdict::kRejected : Verdict::kAccepted;
      if (b == a + 2 && a % 3 == 2) c.verdict = Verdict::kDeactivated;
      c.in_tree = b == a + 1;
      c.num_connected_frames = c.verdict == Verdict::kRejected ? 0 : 12 - 3 * (b - a) + a % 3;
      c.num_common_points = c.verdict == Verdict::kRejected ? 0 : 340 / (b - a) - 7 * (a % 5);
      c.median_angle_deg = c.verdict == Verdict::kRejected ? 0 : 12.5 + 3 * ((a + b) % 4);
      c.strength = c.num_connected_frames + 0.1 * c.num_common_points + 0.1 * c.median_angle_deg * c.median_angle_deg;
      c.num_candidates = 20 + a;
      c.num_inliers = c.verdict == Verdict::kRejected ? 7 : 150;
      c.median_error_px = 0.8;
      c.b_from_a = WorldFromSubmap(b).Inverse() * WorldFromSubmap(a);
      c.reason = c.verdict == Verdict::kAccepted   ? "9 pairs of keyframes agree on one similarity"
                 : c.verdict == Verdict::kRejected ? "only 7 inliers <20 needed> & they lie in one corner of the image"
                                                   : "disagrees by 14 % in scale with the cycle 2-3-4";
      map.connections.push_back(c);
    }
  }
  return map;
}

RefinedSubmap TestFlight::Refinement(int submap) const {
  RefinedSubmap refined;
  refined.key = Key(submap);
  const Similarity3 root_from_submap = WorldFromSubmap(0).Inverse() * WorldFromSubmap(submap);
  for (const Record& record : records_) {
    if (const auto* keyframe = std::get_if<KeyframeRecord>(&record.body);
        keyframe && keyframe->submap.value == submap) {
      refined.keyframes.push_back(
          {keyframe->keyframe, TransformWorld(keyframe->cam_from_submap, root_from_submap), root_from_submap.scale});
    }
    if (const auto* update = std::get_if<MapUpdate>(&record.body); update && update->submap.value == submap) {
      for (const PointPosition& p : update->points)
        refined.points.push_back({p.point, (root_from_submap * p.position.cast<double>()).cast<float>()});
    }
  }
  return refined;
}

MapModel MakeModel(const TestFlight& flight) {
  MapModel model;
  for (const Record& record : flight.Records()) {
    const std::string problem = model.Apply(record);
    EXPECT_EQ(problem, "");
  }
  return model;
}

}  // namespace mapmend
