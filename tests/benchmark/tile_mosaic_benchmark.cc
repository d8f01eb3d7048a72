// What it costs to draw the ground while it is mapped: a survey of strips grows keyframe by keyframe; for each the
// scene is made anew and the tiles that it changes are drawn. One image, a JPEG of 1920 x 1080 pixels that is decoded
// whenever an image is read, stands for all.
//
//     tile_mosaic_benchmark KEYFRAMES FILE.mbtiles
//
// Prints CPU time for each keyframe, that of a last pass over all tiles, and the memory.

#include <sys/resource.h>

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <ctime>
#include <opencv2/core/utility.hpp>
#include <opencv2/imgcodecs.hpp>
#include <opencv2/imgproc.hpp>

#include "libs/base/median.h"
#include "libs/mosaic/brightness.h"
#include "libs/mosaic/tile_mosaic.h"

namespace mapmend {
namespace {

constexpr int kWidth = 1920, kHeight = 1080, kPerStrip = 50;
constexpr double kAltitude = 75, kAlong = 14, kAcross = 38;  // metres: 80 % and 60 % of overlap

double CpuSeconds() {
  timespec t{};
  clock_gettime(CLOCK_PROCESS_CPUTIME_ID, &t);
  return static_cast<double>(t.tv_sec) + 1e-9 * static_cast<double>(t.tv_nsec);
}

MosaicImage ImageAt(int index) {
  MosaicImage image;
  image.camera.width = kWidth;
  image.camera.height = kHeight;
  image.camera.fx = image.camera.fy = 1500;
  image.camera.cx = kWidth / 2.0;
  image.camera.cy = kHeight / 2.0;
  image.camera.distortion = {-0.05, 0.01, 0, 0, 0};
  const int strip = index / kPerStrip, along = index % kPerStrip;
  const bool is_back = strip % 2 == 1;
  const Eigen::Vector3d center(strip * kAcross, (is_back ? kPerStrip - 1 - along : along) * kAlong, kAltitude);
  Eigen::Matrix3d down;
  down << 1, 0, 0, 0, -1, 0, 0, 0, -1;
  const Eigen::Quaterniond q(Eigen::AngleAxisd(is_back ? M_PI : 0, Eigen::Vector3d::UnitZ()).toRotationMatrix() * down);
  image.cam_from_ground = {q, -(q * center)};
  image.id = index;
  return image;
}

std::vector<uint8_t> MakeJpeg() {
  cv::Mat noise(kHeight / 4, kWidth / 4, CV_8UC3), image;
  cv::randu(noise, 40, 210);
  cv::resize(noise, image, {kWidth, kHeight}, 0, 0, cv::INTER_CUBIC);
  std::vector<uint8_t> jpeg;
  cv::imencode(".jpg", image, jpeg, {cv::IMWRITE_JPEG_QUALITY, 90});
  return jpeg;
}

int Run(int num_keyframes, const std::string& path) {
  cv::setNumThreads(1);
  const std::vector<uint8_t> jpeg = MakeJpeg();
  TileFile file(path);
  int num_read = 0;
  TileMosaic tiles({}, &file, [&](int, int) {
    ++num_read;
    return cv::imdecode(jpeg, cv::IMREAD_COLOR);
  });
  std::vector<MosaicImage> images;
  std::vector<Eigen::Vector3d> points;
  std::vector<double> seconds;
  const auto set = [&](bool is_final) {
    TileScene scene;
    scene.zoom = ZoomOf(kAltitude / 1500);
    scene.components.push_back({"a", true, GroundScene({}, images, points)});
    const Eigen::Vector2d focus = images.back().cam_from_ground.Center().head<2>();
    tiles.SetScene(std::move(scene), focus, is_final);
    while (tiles.NumPending() > 0) tiles.Work(std::chrono::steady_clock::now() + std::chrono::milliseconds(250));
  };
  for (int i = 0; i < num_keyframes; ++i) {
    images.push_back(ImageAt(i));
    const Eigen::Vector3d center = images.back().cam_from_ground.Center();
    for (int k = 0; k < 100; ++k)
      points.emplace_back(center.x() + 90 * (k % 10 / 10.0 - 0.5), center.y() + 50 * (k / 100.0 - 0.5),
                          std::sin(center.x() / 40 + k) * 0.5);
    const double begin = CpuSeconds();
    set(false);
    seconds.push_back(CpuSeconds() - begin);
  }
  const int64_t live = tiles.NumMade();
  std::sort(seconds.begin(), seconds.end());
  std::printf(
      "%d keyframes: CPU a keyframe median %.0f, 95 %% %.0f, most %.0f ms; %.1f units, %.1f images read a keyframe\n",
      num_keyframes, 1e3 * Median(seconds), 1e3 * seconds[seconds.size() * 95 / 100], 1e3 * seconds.back(),
      static_cast<double>(live) / num_keyframes, static_cast<double>(num_read) / num_keyframes);
  const double begin = CpuSeconds();
  set(true);
  rusage usage{};
  getrusage(RUSAGE_SELF, &usage);
  std::printf("last pass: %.1f s of CPU, %lld units; peak memory %.0f MB\n", CpuSeconds() - begin,
              static_cast<long long>(tiles.NumMade() - live), static_cast<double>(usage.ru_maxrss) / 1024);
  return 0;
}

}  // namespace
}  // namespace mapmend

int main(int argc, char** argv) {
  if (argc != 3 || std::atoi(argv[1]) < 1) {
    std::fprintf(stderr, "usage: tile_mosaic_benchmark KEYFRAMES FILE.mbtiles\n");
    return 2;
  }
  return mapmend::Run(std::atoi(argv[1]), argv[2]);
}
