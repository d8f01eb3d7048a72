#include "tools/simulate/texture.h"

#include <opencv2/core.hpp>
#include <opencv2/imgcodecs.hpp>
#include <stdexcept>

#include "tools/simulate/parallel.h"

namespace mapmend::simulate {

Image ReadImage(const std::string& path) {
  const cv::Mat pixels = cv::imread(path, cv::IMREAD_COLOR);
  if (pixels.empty()) throw std::runtime_error("texture " + path + ": cannot be read as an image");
  Image image(pixels.cols, pixels.rows);
  for (int y = 0; y < pixels.rows; ++y) {
    for (int x = 0; x < pixels.cols; ++x) {
      const auto& bgr = pixels.at<cv::Vec3b>(y, x);
      image.At(x, y) = bgr[2] | uint32_t{bgr[1]} << 8 | uint32_t{bgr[0]} << 16;
    }
  }
  return image;
}

Texture::Texture(Image image, int num_threads) {
  levels_.push_back(std::move(image));
  while (levels_.size() < 16 && std::min(levels_.back().width, levels_.back().height) > 1) {
    const Image& fine = levels_.back();
    Image coarse(fine.width / 2, fine.height / 2);
    ParallelFor(coarse.height, 16, num_threads, [&](int begin, int end) {
      for (int y = begin; y < end; ++y) {
        for (int x = 0; x < coarse.width; ++x) {
          const Color sum = Unpack(fine.At(2 * x, 2 * y)) + Unpack(fine.At(2 * x + 1, 2 * y)) +
                            Unpack(fine.At(2 * x, 2 * y + 1)) + Unpack(fine.At(2 * x + 1, 2 * y + 1));
          coarse.At(x, y) = Pack(sum * 0.25f);
        }
      }
    });
    levels_.push_back(std::move(coarse));
  }
}

}  // namespace mapmend::simulate
