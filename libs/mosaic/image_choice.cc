#include "libs/mosaic/image_choice.h"

#include <algorithm>
#include <array>

namespace mapmend {
namespace {

constexpr float kUnseen = -1e6F;  // pixels inside the image

// What one image shows at places kChoiceStep apart.
struct NodeSights {
  int image = -1;
  cv::Mat steepness, inside;  // 32-bit float; the steepness by the image's weight
};

// The places, with the height of the surface.
class Lattice {
 public:
  Lattice(const GroundScene& scene, const GroundRaster& raster, const cv::Rect& part)
      : columns_(part.width / kChoiceStep + 2), rows_(part.height / kChoiceStep + 2) {
    for (int row = 0; row < rows_; ++row) {
      for (int column = 0; column < columns_; ++column)
        places_.push_back(scene.OnSurface(raster.Place(part.x + column * kChoiceStep, part.y + row * kChoiceStep)));
    }
  }

  NodeSights See(const GroundScene& scene, int image) const {
    NodeSights sights{image, cv::Mat(rows_, columns_, CV_32F), cv::Mat(rows_, columns_, CV_32F)};
    const GroundView& view = scene.View(image);
    const double weight = scene.Weight(image);
    auto place = places_.begin();
    for (int row = 0; row < rows_; ++row) {
      for (int column = 0; column < columns_; ++column, ++place) {
        const auto sight = view.Project(*place);
        sights.steepness.at<float>(row, column) = sight ? static_cast<float>(weight * sight->steepness) : 0;
        sights.inside.at<float>(row, column) = sight ? static_cast<float>(sight->inside) : kUnseen;
      }
    }
    return sights;
  }
  cv::Size Size() const { return {columns_, rows_}; }

 private:
  int columns_, rows_;
  std::vector<Eigen::Vector3d> places_;
};

// Whether leading images show all of it, not with the outermost of their borders: then no other has a chance.
bool LeadingAreEnough(const GroundScene& scene, const Lattice& lattice, const std::vector<NodeSights>& leading) {
  constexpr double kChance = 0.4;  // of the quality without the border: enough, with GroundScene::kWeightBesideLeading
  cv::Mat is_shown = cv::Mat::zeros(lattice.Size(), CV_8U);
  for (const NodeSights& s : leading) {
    for (int row = 0; row < is_shown.rows; ++row) {
      for (int column = 0; column < is_shown.cols; ++column) {
        const double steepness = s.steepness.at<float>(row, column), inside = s.inside.at<float>(row, column);
        if (scene.View(s.image).Quality(steepness, inside) > kChance * steepness) is_shown.at<uint8_t>(row, column) = 1;
      }
    }
  }
  return cv::countNonZero(is_shown) == lattice.Size().area();
}

// Those that are the best at a place, or nearly so: nobody else is in between.
std::vector<NodeSights> Competitive(const GroundScene& scene, const Lattice& lattice, std::vector<NodeSights> sights) {
  constexpr float kNearly = 0.97F;
  std::vector<cv::Mat> qualities;
  cv::Mat best = cv::Mat::zeros(lattice.Size(), CV_32F);
  for (const NodeSights& s : sights) {
    cv::Mat quality(lattice.Size(), CV_32F);
    for (int row = 0; row < quality.rows; ++row) {
      for (int column = 0; column < quality.cols; ++column)
        quality.at<float>(row, column) = static_cast<float>(
            scene.View(s.image).Quality(s.steepness.at<float>(row, column), s.inside.at<float>(row, column)));
    }
    best = cv::max(best, quality);
    qualities.push_back(quality);
  }
  std::vector<NodeSights> competitive;
  for (size_t i = 0; i < sights.size(); ++i) {
    if (cv::countNonZero((qualities[i] > 0) & (qualities[i] >= kNearly * best)) > 0)
      competitive.push_back(std::move(sights[i]));
  }
  return competitive;
}

// Takes the places where this image is better than those before it.
void Take(const GroundView& view, const NodeSights& sights, cv::Mat* label, cv::Mat* best) {
  for (int y = 0; y < label->rows; ++y) {
    const int r = y / kChoiceStep;
    const float down = static_cast<float>(y % kChoiceStep) / kChoiceStep;
    const auto mix = [&](const cv::Mat& nodes, int column) {
      return (1 - down) * nodes.at<float>(r, column) + down * nodes.at<float>(r + 1, column);
    };
    auto* labels = label->ptr<int16_t>(y);
    auto* bests = best->ptr<float>(y);
    for (int c = 0; c * kChoiceStep < label->cols; ++c) {
      const float steep_west = mix(sights.steepness, c), steep_east = mix(sights.steepness, c + 1);
      const float inside_west = mix(sights.inside, c), inside_east = mix(sights.inside, c + 1);
      if (inside_west < 0 && inside_east < 0) continue;
      const int end = std::min(label->cols, (c + 1) * kChoiceStep);
      for (int x = c * kChoiceStep; x < end; ++x) {
        const float right = static_cast<float>(x - c * kChoiceStep) / kChoiceStep;
        const float steepness = (1 - right) * steep_west + right * steep_east;
        if (steepness <= bests[x]) continue;  // the border makes it no better
        const float inside = (1 - right) * inside_west + right * inside_east;
        const auto quality = static_cast<float>(view.Quality(steepness, inside));
        if (quality <= bests[x]) continue;
        bests[x] = quality;
        labels[x] = static_cast<int16_t>(sights.image);
      }
    }
  }
}

}  // namespace

GroundBounds BoundsOf(const GroundRaster& raster, const cv::Rect& part) {
  const Eigen::Vector2d north_west = raster.Place(part.x, part.y), south_east = raster.Place(part.br().x, part.br().y);
  return {{north_west.x(), south_east.y()}, {south_east.x(), north_west.y()}};
}

ImageChoice ChooseImages(const GroundScene& scene, const GroundRaster& raster, const cv::Rect& part) {
  ImageChoice choice;
  choice.label = cv::Mat(part.size(), CV_16S, cv::Scalar(-1));
  const Lattice lattice(scene, raster, part);
  std::vector<NodeSights> sights;
  const std::vector<int> near = scene.Near(BoundsOf(raster, part));
  const auto look = [&](bool leading) {
    for (const int image : near) {
      if (scene.IsLeading(image) != leading) continue;
      NodeSights seen = lattice.See(scene, image);
      if (cv::countNonZero(seen.inside > 0) > 0) sights.push_back(std::move(seen));
    }
  };
  look(true);
  if (!LeadingAreEnough(scene, lattice, sights)) look(false);
  cv::Mat best = cv::Mat::zeros(part.size(), CV_32F);
  for (const NodeSights& s : Competitive(scene, lattice, std::move(sights))) {
    Take(scene.View(s.image), s, &choice.label, &best);
    choice.images.push_back(s.image);
  }
  std::vector<bool> shows(static_cast<size_t>(scene.NumImages()), false);
  std::for_each(choice.label.begin<int16_t>(), choice.label.end<int16_t>(), [&](int16_t image) {
    if (image >= 0) shows[static_cast<size_t>(image)] = true;
  });
  std::erase_if(choice.images, [&](int image) { return !shows[static_cast<size_t>(image)]; });
  std::sort(choice.images.begin(), choice.images.end());
  return choice;
}

}  // namespace mapmend
