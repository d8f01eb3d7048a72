#include "libs/map_view/snapshot.h"

#include <gtest/gtest.h>

#include "tests/test_flight.h"

namespace mapmend {
namespace snapshot_test {

// Largest distance between the placed frames of a component and the truth, metres.
double LargestError(const TestFlight& flight, const std::vector<MergedFrame>& frames) {
  double largest = 0;
  for (const MergedFrame& frame : frames) {
    const Eigen::Vector3d in_world = flight.WorldFromSubmap(0) * frame.cam_from_root.Center();
    largest = std::max(largest, (in_world - flight.WorldFromCamera(frame.frame).translation).norm());
  }
  return largest;
}

void ApplyAll(MapModel* model, const std::vector<Record>& records) {
  for (const Record& record : records) ASSERT_EQ(model->Apply(record), "");
}

// The flight's records with one more update before the last submap ends.
std::vector<Record> WithUpdate(const TestFlight& flight, const MapUpdate& update) {
  std::vector<Record> records = flight.Records();
  Record record = records[records.size() - 2];
  record.body = update;
  records.insert(records.end() - 2, record);
  for (size_t i = 0; i < records.size(); ++i) records[i].header.seq = static_cast<int64_t>(i);
  return records;
}

TEST(SnapshotTest, TreeTransformsPlaceEveryFrame) {
  const TestFlight flight;
  MapModel model = MakeModel(flight);
  model.SetRevision(flight.Revision());
  const Snapshot snapshot = MakeSnapshot(model);
  ASSERT_EQ(snapshot.components.size(), 1u);
  EXPECT_EQ(snapshot.components[0].frames.size(), 40u);
  EXPECT_EQ(snapshot.components[0].keyframes.size(), 10u);
  EXPECT_EQ(snapshot.num_frames_tracked, 40);
  EXPECT_EQ(snapshot.num_frames_in, 50);
  EXPECT_LT(LargestError(flight, snapshot.components[0].frames), 1e-4);
}

TEST(SnapshotTest, WithoutAMergerEverySubmapStandsAlone) {
  const TestFlight flight;
  const MapModel model = MakeModel(flight);
  const Snapshot snapshot = MakeSnapshot(model);
  ASSERT_EQ(snapshot.components.size(), 2u);
  EXPECT_EQ(snapshot.submaps[1].component, 1);
  EXPECT_TRUE(snapshot.submaps[1].is_root);
  // In its own frame the first camera of a submap is the origin.
  EXPECT_LT(snapshot.components[1].frames[0].cam_from_root.translation.norm(), 1e-9);
}

TEST(SnapshotTest, TheComponentWithMostFramesIsMain) {
  TestFlightOptions options;
  options.num_submaps = 3;
  const TestFlight flight(options);
  MapModel model = MakeModel(flight);
  MapRevision merged = flight.Revision();
  merged.transforms.submaps[0].component = 7;  // alone; the other two belong together
  merged.transforms.submaps[1].component = merged.transforms.submaps[2].component = 9;
  merged.transforms.submaps[1].is_root = true;
  model.SetRevision(merged);
  const Snapshot snapshot = MakeSnapshot(model);
  ASSERT_EQ(snapshot.components.size(), 2u);
  EXPECT_EQ(snapshot.components[0].submaps, (std::vector<int>{1, 2}));
  EXPECT_EQ(snapshot.components[0].root, 1);
  EXPECT_EQ(snapshot.submaps[0].component, 1);
}

TEST(SnapshotTest, RefinedKeyframesCarryTheirFramesWithThem) {
  const TestFlight flight;
  MapModel model = MakeModel(flight);
  MapRevision merged = flight.Revision();
  for (int i = 0; i < 2; ++i) merged.refined.push_back(flight.Refinement(i));
  merged.transforms.submaps[1].root_from_submap = Similarity3();  // the coarse transform must not be used any more
  model.SetRevision(merged);
  EXPECT_LT(LargestError(flight, MakeSnapshot(model).components[0].frames), 1e-4);
}

RefinedSubmap::Keyframe* Find(KeyframeId id, RefinedSubmap* refined) {
  const auto is_it = [&](const RefinedSubmap::Keyframe& keyframe) { return keyframe.id == id; };
  return &*std::find_if(refined->keyframes.begin(), refined->keyframes.end(), is_it);
}

// A refinement that moves a keyframe by one unit in x and doubles the lengths around it.
void MoveAndDouble(RefinedSubmap::Keyframe* keyframe) {
  keyframe->cam_from_root.translation -= keyframe->cam_from_root.rotation * Eigen::Vector3d(1, 0, 0);
  keyframe->scale = 2;
}

// Where submap 0 has the camera.
Eigen::Vector3d TrackedCenter(const TestFlight& flight, int frame) {
  return flight.WorldFromSubmap(0).Inverse() * flight.WorldFromCamera(frame).translation;
}

TEST(SnapshotTest, AFrameOfACulledKeyframeFollowsThoseOnBothSides) {
  TestFlightOptions options;
  options.num_submaps = 1;
  const TestFlight flight(options);
  // Cull keyframe 2 (frames 8 to 11) before the submap ends.
  MapUpdate cull;
  cull.submap = SubmapId(0);
  cull.removed_keyframes = {KeyframeId(2)};
  MapModel model;
  ApplyAll(&model, WithUpdate(flight, cull));
  MapRevision merged = flight.Revision();
  RefinedSubmap refined = flight.Refinement(0);
  std::erase_if(refined.keyframes, [](const auto& k) { return k.id == KeyframeId(2); });
  // Refinement moved keyframe 1 (frame 4) by one unit in x and doubled the lengths around it; the others stayed.
  MoveAndDouble(Find(KeyframeId(1), &refined));
  merged.refined.push_back(refined);
  model.SetRevision(merged);
  const std::vector<MergedFrame> frames = MakeSnapshot(model).submaps[0].frames;
  ASSERT_EQ(frames.size(), 20u);
  const auto center = [&](int frame) { return frames[frame].cam_from_root.Center(); };
  const auto tracked = [&](int frame) { return TrackedCenter(flight, frame); };
  const Eigen::Vector3d moved = tracked(4) + Eigen::Vector3d(1, 0, 0);
  EXPECT_LT((center(4) - moved).norm(), 1e-6);
  for (const int frame : {8, 10, 11}) {
    const Eigen::Vector3d by_first = moved + 2 * (tracked(frame) - tracked(4)), by_second = tracked(frame);
    const double share = (frame - 4) / 8.0;  // of the way from frame 4 to frame 12
    EXPECT_LT((center(frame) - (by_first + share * (by_second - by_first))).norm(), 1e-6) << frame;
  }
  EXPECT_LT((center(12) - tracked(12)).norm(), 1e-6) << "keyframe 3 stayed";
  EXPECT_EQ(MakeSnapshot(model).components[0].keyframes.size(), 4u);
}

TEST(SnapshotTest, AFrameOfAKeyframeThatIsNotRefinedFollowsThoseThatAre) {
  TestFlightOptions options;
  options.num_submaps = 1;
  const TestFlight flight(options);
  MapModel model = MakeModel(flight);
  MapRevision merged = flight.Revision();
  RefinedSubmap refined = flight.Refinement(0);
  std::erase_if(refined.keyframes, [](const auto& k) { return k.id == KeyframeId(2); });  // frames 8 to 11
  MoveAndDouble(Find(KeyframeId(3), &refined));
  merged.refined.push_back(refined);
  model.SetRevision(merged);
  const std::vector<MergedFrame> frames = MakeSnapshot(model).submaps[0].frames;
  const auto center = [&](int frame) { return frames[frame].cam_from_root.Center(); };
  const auto tracked = [&](int frame) { return TrackedCenter(flight, frame); };
  // Keyframe 1 (frame 4) stayed, keyframe 3 (frame 12) did not.
  const Eigen::Vector3d moved = tracked(12) + Eigen::Vector3d(1, 0, 0);
  for (const int frame : {5, 8, 10}) {
    const Eigen::Vector3d by_first = tracked(frame), by_second = moved + 2 * (tracked(frame) - tracked(12));
    const double share = (frame - 4) / 8.0;
    EXPECT_LT((center(frame) - (by_first + share * (by_second - by_first))).norm(), 1e-6) << frame;
  }
}

TEST(SnapshotTest, AFrameTrackedInTwoSubmapsCountsOnce) {
  const TestFlight flight;
  // Submap 1 (keyframe 5 at frame 25) also tracked frame 19, the last of submap 0, backwards.
  MapUpdate backwards;
  backwards.submap = SubmapId(1);
  backwards.frames.push_back(
      {19, TestFlight::Utime(19), KeyframeId(5), Rigid3(Eigen::Matrix3d::Identity(), {9, 9, 9})});
  MapModel model;
  ApplyAll(&model, WithUpdate(flight, backwards));
  model.SetRevision(flight.Revision());
  const Snapshot snapshot = MakeSnapshot(model);
  EXPECT_EQ(snapshot.num_frames_tracked, 40);
  EXPECT_EQ(snapshot.components[0].frames.size(), 40u);
  EXPECT_EQ(snapshot.submaps[1].frames.size(), 21u);
  // Keyframe 4 of submap 0 (frame 16) is nearer in time than keyframe 5 (frame 25).
  EXPECT_LT(LargestError(flight, snapshot.components[0].frames), 1e-4);
}

TEST(SnapshotTest, NumbersGoOnFromSessionToSession) {
  const TestFlight first;
  TestFlightOptions options;
  options.session = "00000000-0000-0000-0000-000000000000";  // sorts before the first, but comes later
  const TestFlight second(options);
  MapModel model = MakeModel(first);
  ApplyAll(&model, second.Records());
  const Snapshot snapshot = MakeSnapshot(model);
  ASSERT_EQ(snapshot.submaps.size(), 4u);
  for (int i = 0; i < 4; ++i) EXPECT_EQ(snapshot.submaps[i].number, i);
  EXPECT_EQ(snapshot.submaps[2].key.session, options.session);
  EXPECT_EQ(snapshot.num_frames_in, 100);
  EXPECT_EQ(snapshot.num_frames_tracked, 80);
}

TEST(ComponentPointsTest, AreColouredAndFusedOnesAreListedOnce) {
  const TestFlight flight;
  MapModel model = MakeModel(flight);
  MapRevision merged = flight.Revision();
  for (int i = 0; i < 2; ++i) merged.refined.push_back(flight.Refinement(i));
  RefinedSubmap& second = merged.refined[1];
  second.fused.push_back({MapPointId(12), flight.Key(0).session, MapPointId(0)});
  std::erase_if(second.points,
                [](const auto& p) { return p.id == MapPointId(13); });  // refinement found it to be wrong
  model.SetRevision(merged);
  const std::vector<ColoredPoint> points = ComponentPoints(MakeSnapshot(model), 0);
  ASSERT_EQ(points.size(), 22u);
  EXPECT_EQ(points[3].color, (std::array<uint8_t, 3>{30, 0, 200}));
  EXPECT_LT((flight.WorldFromSubmap(0) * points[3].position - Eigen::Vector3d(30, 0, 0)).norm(), 1e-4);
  EXPECT_EQ(points[12].id, MapPointId(14));
  EXPECT_EQ(points[12].color, (std::array<uint8_t, 3>{20, 1, 200}));
}

TEST(MapModelTest, BadRecordsAndOldRevisionsChangeNothing) {
  const TestFlight flight;
  MapModel model;
  EXPECT_NE(model.Apply(flight.Records()[2]), "") << "an update of a submap that was never started";
  EXPECT_TRUE(model.SessionOrder().empty());
  ASSERT_EQ(model.Apply(flight.Records()[0]), "");
  ASSERT_EQ(model.Apply(flight.Records()[1]), "");
  EXPECT_NE(model.Apply(flight.Records()[1]), "") << "the same record again";
  EXPECT_TRUE(model.SetRevision(flight.Revision()));
  MapRevision old;
  old.transforms.revision = 2;
  EXPECT_FALSE(model.SetRevision(old));
  EXPECT_EQ(model.Revision().transforms.revision, 3);
}

}  // namespace snapshot_test
}  // namespace mapmend
