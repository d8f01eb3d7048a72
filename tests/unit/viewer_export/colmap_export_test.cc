#include <gtest/gtest.h>

#include <cstring>
#include <map>
#include <sstream>

#include "procs/viewer_export/colmap_model.h"
#include "tests/test_flight.h"

namespace mapmend {
namespace colmap_export_test {

std::vector<std::string> Lines(const std::string& text) {
  std::vector<std::string> lines;
  std::istringstream stream(text);
  for (std::string line; std::getline(stream, line);) {
    if (line.empty() || line[0] != '#') lines.push_back(line);
  }
  return lines;
}

MapModel RefinedModel(const TestFlight& flight) {
  MapModel model = MakeModel(flight);
  MapRevision revision = flight.Revision();
  for (int i = 0; i < 2; ++i) revision.refined.push_back(flight.Refinement(i));
  // Point 13 of submap 1 is the same as point 1 of submap 0 (as far as the lists go).
  revision.refined[1].fused.push_back({MapPointId(13), flight.Key(0).session, MapPointId(1)});
  model.SetRevision(revision);
  return model;
}

TEST(ColmapExportTest, PointsReprojectOntoTheirFeatures) {
  const TestFlight flight;
  const MapModel model = RefinedModel(flight);
  const ColmapFiles colmap = ToColmapText(MakeColmapModel(MakeSnapshot(model), 0, {}, 1e9));

  int camera_id = 0, width = 0, height = 0;
  double fx = 0, fy = 0, cx = 0, cy = 0;
  ASSERT_EQ(Lines(colmap.cameras).size(), 1u);
  ASSERT_EQ(std::sscanf(Lines(colmap.cameras)[0].c_str(), "%d PINHOLE %d %d %lf %lf %lf %lf", &camera_id, &width,
                        &height, &fx, &fy, &cx, &cy),
            7);
  EXPECT_EQ(width, 640);
  EXPECT_EQ(cx, 320.5);

  struct Image {
    Rigid3 cam_from_root;
    std::vector<Eigen::Vector3d> features;  // x, y, point id
  };
  std::map<int, Image> images;
  const std::vector<std::string> image_lines = Lines(colmap.images);
  ASSERT_EQ(image_lines.size(), 20u);
  for (size_t i = 0; i < image_lines.size(); i += 2) {
    std::istringstream head(image_lines[i]), body(image_lines[i + 1]);
    int id = 0, camera = 0;
    double qw, qx, qy, qz, tx, ty, tz;
    std::string name;
    ASSERT_TRUE(head >> id >> qw >> qx >> qy >> qz >> tx >> ty >> tz >> camera >> name);
    EXPECT_EQ(camera, camera_id);
    Image image{Rigid3(Eigen::Quaterniond(qw, qx, qy, qz), {tx, ty, tz}), {}};
    for (Eigen::Vector3d f; body >> f.x() >> f.y() >> f.z();) image.features.push_back(f);
    images[id] = image;
    if (i == 2) {
      EXPECT_EQ(name, "0/frame_000004.jpg");
    }
  }

  const std::vector<std::string> point_lines = Lines(colmap.points);
  EXPECT_EQ(point_lines.size(), 23u) << "the fused point is not listed";
  for (const std::string& line : point_lines) {
    std::istringstream stream(line);
    int id = 0, r, g, b, image_id, feature;
    Eigen::Vector3d p;
    double error = 1;
    ASSERT_TRUE(stream >> id >> p.x() >> p.y() >> p.z() >> r >> g >> b >> error);
    int length = 0;
    for (; stream >> image_id >> feature; ++length) {
      const Eigen::Vector3d& f = images.at(image_id).features.at(feature);
      EXPECT_EQ(f.z(), id) << "the image names the point that names the image";
      if (id == 2) continue;  // the point with another's observations
      const Eigen::Vector3d c = images.at(image_id).cam_from_root * p;
      EXPECT_NEAR(fx * c.x() / c.z() + cx, f.x(), 0.01);
      EXPECT_NEAR(fy * c.y() / c.z() + cy, f.y(), 0.01);
    }
    EXPECT_EQ(length, id == 2 ? 10 : 5) << "point 1 has its own five observations and five of point 13";
    EXPECT_TRUE(id == 2 || error < 0.01);
  }
}

// The bytes of a binary model, read as COLMAP's documentation says.
class Reader {
 public:
  explicit Reader(const std::string& bytes) : bytes_(bytes) {}
  template <typename T>
  T Next() {
    T value{};
    if (at_ + sizeof(T) <= bytes_.size()) std::memcpy(&value, bytes_.data() + at_, sizeof(T));
    at_ += sizeof(T);
    return value;
  }
  std::string NextText() {
    const std::string text = bytes_.c_str() + at_;
    at_ += text.size() + 1;
    return text;
  }
  bool IsAtEnd() const { return at_ == bytes_.size(); }

 private:
  const std::string bytes_;
  size_t at_ = 0;
};

TEST(ColmapExportTest, BinaryAndTextSayTheSame) {
  const TestFlight flight;
  const MapModel map = RefinedModel(flight);
  const ColmapModel model = MakeColmapModel(MakeSnapshot(map), 0, {}, 1e9);
  const ColmapFiles files = ToColmapBinary(model);
  Reader cameras(files.cameras), images(files.images), points(files.points);
  ASSERT_EQ(cameras.Next<uint64_t>(), 1u);
  EXPECT_EQ(cameras.Next<int32_t>(), 1);
  EXPECT_EQ(cameras.Next<int32_t>(), 1) << "PINHOLE";
  EXPECT_EQ(cameras.Next<uint64_t>(), 640u);
  cameras.Next<uint64_t>();
  for (const double param : model.cameras[0].params) EXPECT_EQ(cameras.Next<double>(), param);
  EXPECT_TRUE(cameras.IsAtEnd());
  ASSERT_EQ(images.Next<uint64_t>(), model.images.size());
  for (const ColmapModel::Image& image : model.images) {
    EXPECT_EQ(images.Next<int32_t>(), image.id);
    EXPECT_EQ(images.Next<double>(), image.cam_from_world.rotation.w());
    for (int i = 0; i < 6; ++i) images.Next<double>();
    EXPECT_EQ(images.Next<int32_t>(), image.camera);
    EXPECT_EQ(images.NextText(), image.name);
    ASSERT_EQ(images.Next<uint64_t>(), image.features.size());
    for (const ColmapModel::Feature& feature : image.features) {
      EXPECT_EQ(images.Next<double>(), feature.x);
      EXPECT_EQ(images.Next<double>(), feature.y);
      EXPECT_EQ(images.Next<int64_t>(), feature.point);
    }
  }
  EXPECT_TRUE(images.IsAtEnd());
  ASSERT_EQ(points.Next<uint64_t>(), model.points.size());
  for (const ColmapModel::Point& point : model.points) {
    EXPECT_EQ(points.Next<uint64_t>(), static_cast<uint64_t>(point.id));
    EXPECT_EQ(points.Next<double>(), point.position.x());
    points.Next<double>();
    points.Next<double>();
    for (const uint8_t channel : point.color) EXPECT_EQ(points.Next<uint8_t>(), channel);
    EXPECT_EQ(points.Next<double>(), point.error);
    ASSERT_EQ(points.Next<uint64_t>(), point.track.size());
    for (size_t i = 0; i < point.track.size(); ++i) {
      EXPECT_EQ(points.Next<int32_t>(), point.track[i].image);
      EXPECT_EQ(points.Next<int32_t>(), point.track[i].feature);
    }
  }
  EXPECT_TRUE(points.IsAtEnd());
}

TEST(ColmapExportTest, WhatIsFarOffIsLeftOut) {
  const TestFlight flight;
  const MapModel map = RefinedModel(flight);
  const ColmapModel model = MakeColmapModel(MakeSnapshot(map), 0, {});
  for (const ColmapModel::Point& point : model.points) {
    EXPECT_LT(point.error, 0.01);
    EXPECT_EQ(point.track.size(), 5u) << "point " << point.id << " has lost the observations of another";
  }
}

TEST(ColmapExportTest, APictureOfAnotherSizeHasACameraOfItsOwn) {
  const TestFlight flight;
  const MapModel map = RefinedModel(flight);
  const Snapshot snapshot = MakeSnapshot(map);
  const SnapshotKeyframe& first = snapshot.components[0].keyframes[0];
  const std::string session = snapshot.submaps[static_cast<size_t>(first.submap)].key.session;
  const ColmapModel whole = MakeColmapModel(snapshot, 0, {});
  const ColmapModel model = MakeColmapModel(snapshot, 0, {{{session, first.id}, {"0/x.jpg", 320, 240}}});
  ASSERT_EQ(model.cameras.size(), 2u);
  EXPECT_EQ(model.images[0].name, "0/x.jpg");
  const ColmapCamera& camera = model.cameras[static_cast<size_t>(model.images[0].camera) - 1];
  EXPECT_EQ(camera.width, 320);
  for (size_t i = 0; i < model.images[0].features.size(); ++i) {
    EXPECT_NEAR(model.images[0].features[i].x, whole.images[0].features[i].x * 320 / 640, 1e-3);
    EXPECT_EQ(model.images[0].features[i].point, whole.images[0].features[i].point);
  }
}

TEST(ColmapExportTest, LensesHaveTheirModels) {
  Camera camera;
  camera.width = 640, camera.height = 480;
  camera.fx = camera.fy = 500, camera.cx = 319.5, camera.cy = 239.5;
  EXPECT_EQ(ToColmapCamera(camera)->model, "PINHOLE");
  EXPECT_EQ(ToColmapCamera(camera)->params, (std::vector<double>{500, 500, 320, 240}));
  camera.distortion = {0.1, 0.2, 0.3, 0.4};
  EXPECT_EQ(ToColmapCamera(camera)->model, "OPENCV");
  EXPECT_EQ(ToColmapCamera(camera)->params, (std::vector<double>{500, 500, 320, 240, 0.1, 0.2, 0.3, 0.4}));
  camera.distortion[4] = 0.5;
  EXPECT_EQ(ToColmapCamera(camera)->model, "FULL_OPENCV");
  EXPECT_EQ(ToColmapCamera(camera)->params.size(), 12u);
  camera.model = Camera::Model::kFisheye;
  EXPECT_EQ(ToColmapCamera(camera)->model, "OPENCV_FISHEYE");
  camera.model = Camera::Model::kRational;
  EXPECT_EQ(ToColmapCamera(camera)->model, "FULL_OPENCV");
  camera.distortion[12] = 0.01;
  EXPECT_FALSE(ToColmapCamera(camera)) << "a tilted sensor";
  camera.model = Camera::Model::kDoubleSphere;
  EXPECT_FALSE(ToColmapCamera(camera));
}

}  // namespace colmap_export_test
}  // namespace mapmend
