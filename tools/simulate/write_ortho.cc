#include <algorithm>
#include <cmath>
#include <opencv2/imgcodecs.hpp>
#include <stdexcept>
#include <vector>

#include "libs/base/text_format.h"
#include "libs/base/write_file.h"
#include "tools/simulate/parallel.h"
#include "tools/simulate/simulator.h"

namespace mapmend::simulate {

void WriteOrtho(const Simulator& simulator, double gsd, const std::string& dir) {
  const Scene& scene = simulator.GetScene();
  const HeightGrid& grid = scene.grid;
  const double west = grid.x0, north = grid.y0 + (grid.height - 1) * grid.spacing;
  const int width = static_cast<int>((grid.width - 1) * grid.spacing / gsd),
            height = static_cast<int>((grid.height - 1) * grid.spacing / gsd);
  constexpr int kMostPixels = 32000;  // each way
  if (width < 1 || height < 1 || width > kMostPixels || height > kMostPixels) {
    throw std::runtime_error(Format("--ortho %g: the land would be %d x %d pixels", gsd, width, height));
  }
  cv::Mat picture(height, width, CV_8UC3);
  ParallelFor(height, 16, simulator.NumThreads(), [&](int begin, int end) {
    for (int row = begin; row < end; ++row) {
      for (int column = 0; column < width; ++column) {
        const Eigen::Vector3d origin(west + (column + 0.5) * gsd, north - (row + 0.5) * gsd, scene.survey_height);
        const Eigen::Vector3d down(0, 0, -1);
        const Hit hit = scene.Cast(origin, down);
        const uint32_t rgb = Pack(scene.Shade(origin, down, hit, gsd / std::max(1.0, hit.distance)));
        picture.at<cv::Vec3b>(row, column) = {static_cast<uint8_t>(rgb >> 16), static_cast<uint8_t>(rgb >> 8),
                                              static_cast<uint8_t>(rgb)};
      }
    }
  });
  std::vector<uint8_t> png;
  cv::imencode(".png", picture, png, {cv::IMWRITE_PNG_COMPRESSION, 1});
  WriteFile(dir + "/ortho.png", std::string(png.begin(), png.end()));
  // A world file: pixel size, no turn, centre of the first pixel.
  WriteFile(dir + "/ortho.pgw",
            Format("%.10g\n0\n0\n%.10g\n%.10g\n%.10g\n", gsd, -gsd, west + gsd / 2, north - gsd / 2));
}

}  // namespace mapmend::simulate
