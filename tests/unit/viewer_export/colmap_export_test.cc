#include "procs/viewer_export/colmap_export.h"

#include <gtest/gtest.h>

#include <map>
#include <sstream>

#include "tests/unit/viewer_export/test_flight.h"

namespace mapmend {
namespace {

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
  const ColmapModel colmap = MakeColmapModel(MakeSnapshot(model), 0);

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
      EXPECT_EQ(name, "0/frame_000004.png");
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

}  // namespace
}  // namespace mapmend
