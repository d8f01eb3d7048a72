// The picture of the ground of a mended survey against the simulator's exact picture of the same land.

#include <gdal_priv.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <opencv2/imgcodecs.hpp>
#include <opencv2/imgproc.hpp>
#include <sstream>

#include "libs/base/write_file.h"
#include "libs/geometry/alignment.h"
#include "libs/geometry/read_trajectory.h"
#include "tests/e2e/map_scenario.h"

namespace mapmend {
namespace mosaic_test {

constexpr double kOrthoGsd = 0.1;  // metres

// Bands of a GeoTIFF as one grey picture, and where it lies.
struct GroundPicture {
  cv::Mat grey, mask;
  double west = 0, north = 0, gsd = 1;

  Eigen::Vector2d Place(double column, double row) const {
    return {west + (column + 0.5) * gsd, north - (row + 0.5) * gsd};
  }
};

cv::Mat ReadBand(GDALRasterBand* band) {
  cv::Mat image(band->GetYSize(), band->GetXSize(), CV_8U);
  EXPECT_EQ(band->RasterIO(GF_Read, 0, 0, image.cols, image.rows, image.data, image.cols, image.rows, GDT_Byte, 0, 0,
                           nullptr),
            CE_None);
  return image;
}

GroundPicture ReadMosaic(const std::string& path) {
  GroundPicture picture;
  GDALAllRegister();
  auto* dataset = static_cast<GDALDataset*>(GDALOpen(path.c_str(), GA_ReadOnly));
  if (dataset == nullptr) return picture;
  double transform[6];
  dataset->GetGeoTransform(transform);
  picture.west = transform[0];
  picture.north = transform[3];
  picture.gsd = transform[1];
  std::vector<cv::Mat> bands;
  for (int b = 3; b >= 1; --b) bands.push_back(ReadBand(dataset->GetRasterBand(b)));
  picture.mask = ReadBand(dataset->GetRasterBand(1)->GetMaskBand());
  cv::Mat color;
  cv::merge(bands, color);
  cv::cvtColor(color, picture.grey, cv::COLOR_BGR2GRAY);
  GDALClose(dataset);
  return picture;
}

// The exact picture, resampled to the raster of the mosaic.
cv::Mat Truth(const GroundPicture& mosaic, const Similarity3& truth_from_map, const std::string& flight) {
  const cv::Mat ortho = cv::imread(flight + "/ortho.png", cv::IMREAD_GRAYSCALE);
  double west = 0, north = 0;  // centre of the first pixel
  std::istringstream world(ReadFile(flight + "/ortho.pgw"));
  double ignored = 0;
  world >> ignored >> ignored >> ignored >> ignored >> west >> north;
  cv::Mat map_x(mosaic.grey.size(), CV_32F), map_y(mosaic.grey.size(), CV_32F);
  for (int row = 0; row < map_x.rows; ++row) {
    for (int column = 0; column < map_x.cols; ++column) {
      const Eigen::Vector2d place = mosaic.Place(column, row);
      const Eigen::Vector3d x = truth_from_map * Eigen::Vector3d(place.x(), place.y(), 0);
      map_x.at<float>(row, column) = static_cast<float>((x.x() - west) / kOrthoGsd);
      map_y.at<float>(row, column) = static_cast<float>((north - x.y()) / kOrthoGsd);
    }
  }
  cv::Mat truth;
  cv::remap(ortho, truth, map_x, map_y, cv::INTER_LINEAR, cv::BORDER_CONSTANT, cv::Scalar(0));
  return truth;
}

// How far each block of the mosaic lies from where it belongs, pixels, ascending. Of the ground that was surveyed: what
// lies farther from every camera than the strips from each other is seen from the side only, and houses lean.
std::vector<double> Displacements(const GroundPicture& mosaic, const cv::Mat& truth, const Similarity3& truth_from_map,
                                  const Trajectory& cameras) {
  constexpr int kBlock = 64;
  constexpr double kSpacing = 26;  // of the strips, metres
  const auto is_surveyed = [&](int x, int y) {
    const Eigen::Vector2d place = mosaic.Place(x, y);
    const Eigen::Vector3d ground = truth_from_map * Eigen::Vector3d(place.x(), place.y(), 0);
    return std::any_of(cameras.begin(), cameras.end(), [&](const StampedPose& pose) {
      return (pose.world_from_camera.translation - ground).head<2>().norm() < kSpacing;
    });
  };
  std::vector<double> displacements;
  cv::Mat window;
  cv::createHanningWindow(window, {kBlock, kBlock}, CV_32F);
  for (int y = 0; y + kBlock <= mosaic.grey.rows; y += kBlock) {
    for (int x = 0; x + kBlock <= mosaic.grey.cols; x += kBlock) {
      const cv::Rect block(x, y, kBlock, kBlock);
      if (!is_surveyed(x + kBlock / 2, y + kBlock / 2)) continue;
      if (cv::countNonZero(mosaic.mask(block)) < kBlock * kBlock) continue;
      cv::Mat a, b;
      mosaic.grey(block).convertTo(a, CV_32F);
      truth(block).convertTo(b, CV_32F);
      double response = 0;
      const cv::Point2d shift = cv::phaseCorrelate(a, b, window, &response);
      constexpr double kClear = 0.15;  // grass that the wind moves tells nothing
      if (response > kClear) displacements.push_back(std::hypot(shift.x, shift.y));
    }
  }
  std::sort(displacements.begin(), displacements.end());
  return displacements;
}

TEST(Mosaic, LiesWhereTheLandIs) {
  const ScenarioRun run("two_strips", {"--ortho", "0.1"}, {"--frame", "level"});
  ASSERT_FALSE(run.summary.is_null());
  ASSERT_EQ(run.summary["components"].size(), 1u);
  ASSERT_GE(run.summary["submaps"].size(), 2u) << "the interruption tears the map";
  const GroundPicture mosaic = ReadMosaic(run.out + "/mosaic.tif");
  ASSERT_FALSE(mosaic.grey.empty()) << run.output;
  const Trajectory truth = ReadTrajectoryFile(run.flight + "/groundtruth.tum").poses;
  const Evaluation aligned = EvaluateTrajectory(ReadTrajectoryFile(run.out + "/frames.tum").poses, truth, {});
  ASSERT_TRUE(aligned.success) << aligned.reason;
  const cv::Mat exact = Truth(mosaic, aligned.reference_from_estimate, run.flight);
  const std::vector<double> displacements = Displacements(mosaic, exact, aligned.reference_from_estimate, truth);
  ASSERT_GT(displacements.size(), 100u);
  EXPECT_LE(displacements[displacements.size() / 2], 1.5) << "median, ground pixels";
  EXPECT_LE(displacements[displacements.size() * 9 / 10], 4) << "of 90 %, ground pixels";
  const double area = run.summary["mosaic"].at("area");
  EXPECT_GT(area, 0);
}

}  // namespace mosaic_test
}  // namespace mapmend
