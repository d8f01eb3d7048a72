#include "procs/viewer_export/coverage.h"

#include <algorithm>
#include <cmath>
#include <map>
#include <utility>

#include "libs/base/median.h"

namespace mapmend {
namespace {

constexpr int kMaxSide = 2000;  // cells

// A picture of yes and no on the grid.
class Mask {
 public:
  Mask(int width, int height) : width_(width), height_(height), cells_(static_cast<size_t>(width) * height, 0) {}
  char& At(int x, int y) { return cells_[static_cast<size_t>(y) * width_ + x]; }
  bool Has(int x, int y) const {
    return x >= 0 && y >= 0 && x < width_ && y < height_ && cells_[static_cast<size_t>(y) * width_ + x] != 0;
  }
  // Grown by so many cells to every side, or shrunk if negative; beyond the border nothing is set.
  Mask Grown(int by) const { return by >= 0 ? AlongX(by, 1).AlongY(by, 1) : AlongX(-by, 0).AlongY(-by, 0); }

 private:
  // What is set where any of 2 n + 1 neighbours is (value 1), or where none of them is not (value 0).
  template <typename Get>
  static void Spread(int length, int n, bool value, const Get& get, std::vector<char>* out) {
    int last = -n - 1;  // the latest cell that has the value
    std::vector<int> before(static_cast<size_t>(length)), behind(static_cast<size_t>(length));
    for (int i = 0; i < length; ++i) {
      if (get(i) == value) last = i;
      before[static_cast<size_t>(i)] = i - last;
    }
    last = length + n;
    for (int i = length - 1; i >= 0; --i) {
      if (get(i) == value) last = i;
      behind[static_cast<size_t>(i)] = last - i;
    }
    for (int i = 0; i < length; ++i) {
      bool is_near = before[static_cast<size_t>(i)] <= n || behind[static_cast<size_t>(i)] <= n;
      if (!value) is_near = is_near || i < n || i + n >= length;
      (*out)[static_cast<size_t>(i)] = is_near == value;
    }
  }
  Mask AlongX(int n, bool value) const {
    Mask result(width_, height_);
    std::vector<char> line(static_cast<size_t>(width_));
    for (int y = 0; y < height_; ++y) {
      Spread(
          width_, n, value, [&](int x) { return Has(x, y); }, &line);
      for (int x = 0; x < width_; ++x) result.At(x, y) = line[static_cast<size_t>(x)];
    }
    return result;
  }
  Mask AlongY(int n, bool value) const {
    Mask result(width_, height_);
    std::vector<char> line(static_cast<size_t>(height_));
    for (int x = 0; x < width_; ++x) {
      Spread(
          height_, n, value, [&](int y) { return Has(x, y); }, &line);
      for (int y = 0; y < height_; ++y) result.At(x, y) = line[static_cast<size_t>(y)];
    }
    return result;
  }

  int width_, height_;
  std::vector<char> cells_;
};

bool IsInside(const Footprint& footprint, const Eigen::Vector2d& at) {
  int side = 0;
  for (size_t i = 0; i < 4; ++i) {
    const Eigen::Vector2d a = footprint.corners[i].head<2>(), b = footprint.corners[(i + 1) % 4].head<2>();
    const double cross = (b - a).x() * (at - a).y() - (b - a).y() * (at - a).x();
    const int sign = cross > 0 ? 1 : -1;
    if (side != 0 && sign != side) return false;
    side = sign;
  }
  return true;
}

void CountFootprint(const Footprint& footprint, Coverage* coverage) {
  Eigen::Vector2d low = footprint.corners[0].head<2>(), high = low;
  for (const Eigen::Vector3d& corner : footprint.corners) {
    low = low.cwiseMin(corner.head<2>());
    high = high.cwiseMax(corner.head<2>());
  }
  const Eigen::Vector2d first = (low - coverage->corner) / coverage->cell,
                        last = (high - coverage->corner) / coverage->cell;
  for (int y = std::max(0, static_cast<int>(first.y()));
       y <= std::min(coverage->height - 1, static_cast<int>(last.y())); ++y) {
    for (int x = std::max(0, static_cast<int>(first.x()));
         x <= std::min(coverage->width - 1, static_cast<int>(last.x())); ++x) {
      const Eigen::Vector2d at = coverage->corner + coverage->cell * Eigen::Vector2d(x + 0.5, y + 0.5);
      uint16_t& count = coverage->counts[static_cast<size_t>(y) * coverage->width + x];
      if (count < 65535 && IsInside(footprint, at)) ++count;
    }
  }
}

// The rings around a set of cells, from the edges that they do not share with each other.
std::vector<std::vector<Eigen::Vector2d>> RingsOf(const std::vector<std::pair<int, int>>& cells,
                                                  const Coverage& coverage) {
  using Node = std::pair<int, int>;
  std::map<Node, std::vector<Node>> next;  // directed, the cells to the left
  Mask mask(coverage.width, coverage.height);
  for (const auto& [x, y] : cells) mask.At(x, y) = 1;
  for (const auto& [x, y] : cells) {
    if (!mask.Has(x, y - 1)) next[{x, y}].push_back({x + 1, y});
    if (!mask.Has(x + 1, y)) next[{x + 1, y}].push_back({x + 1, y + 1});
    if (!mask.Has(x, y + 1)) next[{x + 1, y + 1}].push_back({x, y + 1});
    if (!mask.Has(x - 1, y)) next[{x, y + 1}].push_back({x, y});
  }
  std::vector<std::vector<Eigen::Vector2d>> rings;
  while (!next.empty()) {
    std::vector<Node> ring;
    const Node start = next.begin()->first;
    Node at = start, from = start;
    do {
      auto it = next.find(at);
      if (it == next.end()) break;
      // Where two cells touch at a corner, stay with the one that was followed: turn left.
      size_t choice = 0;
      if (it->second.size() == 2) {
        const auto left = [&](const Node& to) {
          return (at.first - from.first) * (to.second - at.second) - (at.second - from.second) * (to.first - at.first);
        };
        choice = left(it->second[1]) > left(it->second[0]) ? 1 : 0;
      }
      const Node to = it->second[choice];
      it->second.erase(it->second.begin() + static_cast<long>(choice));
      if (it->second.empty()) next.erase(it);
      // Corners only.
      const size_t n = ring.size();
      if (n >= 2 && (ring[n - 1].first - ring[n - 2].first) * (at.second - ring[n - 1].second) ==
                        (ring[n - 1].second - ring[n - 2].second) * (at.first - ring[n - 1].first))
        ring.pop_back();
      ring.push_back(at);
      from = at;
      at = to;
    } while (at != start);
    rings.emplace_back();
    for (const Node& node : ring)
      rings.back().push_back(coverage.corner + coverage.cell * Eigen::Vector2d(node.first, node.second));
  }
  const auto area = [](const std::vector<Eigen::Vector2d>& ring) {
    double twice = 0;
    for (size_t i = 0; i < ring.size(); ++i) {
      const Eigen::Vector2d &a = ring[i], &b = ring[(i + 1) % ring.size()];
      twice += a.x() * b.y() - a.y() * b.x();
    }
    return twice;
  };
  std::stable_sort(rings.begin(), rings.end(), [&](const auto& a, const auto& b) { return area(a) > area(b); });
  return rings;
}

CoverageRegion MakeRegion(const std::vector<std::pair<int, int>>& cells, const Coverage& coverage) {
  CoverageRegion region;
  region.fewest_images = coverage.Count(cells[0].first, cells[0].second);
  const double cell_area = coverage.cell * coverage.cell;
  for (const auto& [x, y] : cells) {
    const int count = coverage.Count(x, y);
    region.fewest_images = std::min(region.fewest_images, count);
    region.area += cell_area;
    if (count == 0) region.area_unseen += cell_area;
    region.center +=
        (coverage.corner + coverage.cell * Eigen::Vector2d(x + 0.5, y + 0.5)) / static_cast<double>(cells.size());
  }
  region.rings = RingsOf(cells, coverage);
  return region;
}

void FindRegions(double smallest_area, Mask open, Coverage* coverage) {
  for (int y = 0; y < coverage->height; ++y) {
    for (int x = 0; x < coverage->width; ++x) {
      if (!open.Has(x, y)) continue;
      std::vector<std::pair<int, int>> cells, queue = {{x, y}};
      open.At(x, y) = 0;
      while (!queue.empty()) {
        const auto [cx, cy] = queue.back();
        queue.pop_back();
        cells.emplace_back(cx, cy);
        for (const auto& [dx, dy] : {std::pair(1, 0), {-1, 0}, {0, 1}, {0, -1}}) {
          if (!open.Has(cx + dx, cy + dy)) continue;
          open.At(cx + dx, cy + dy) = 0;
          queue.emplace_back(cx + dx, cy + dy);
        }
      }
      if (static_cast<double>(cells.size()) * coverage->cell * coverage->cell >= smallest_area)
        coverage->regions.push_back(MakeRegion(cells, *coverage));
    }
  }
  std::stable_sort(coverage->regions.begin(), coverage->regions.end(),
                   [](const auto& a, const auto& b) { return a.area > b.area; });
}

// Cells without an image that cannot be reached from outside count as inside.
void FillEnclosed(const Coverage& coverage, Mask* outline) {
  Mask outside(coverage.width, coverage.height);
  std::vector<std::pair<int, int>> queue;
  const auto visit = [&](int x, int y) {
    if (x < 0 || y < 0 || x >= coverage.width || y >= coverage.height || outline->Has(x, y) || outside.Has(x, y))
      return;
    outside.At(x, y) = 1;
    queue.emplace_back(x, y);
  };
  for (int x = 0; x < coverage.width; ++x) {
    visit(x, 0);
    visit(x, coverage.height - 1);
  }
  for (int y = 0; y < coverage.height; ++y) {
    visit(0, y);
    visit(coverage.width - 1, y);
  }
  while (!queue.empty()) {
    const auto [x, y] = queue.back();
    queue.pop_back();
    visit(x + 1, y);
    visit(x - 1, y);
    visit(x, y + 1);
    visit(x, y - 1);
  }
  for (int y = 0; y < coverage.height; ++y) {
    for (int x = 0; x < coverage.width; ++x) outline->At(x, y) = !outside.Has(x, y);
  }
}

}  // namespace

Coverage MeasureCoverage(const std::vector<Footprint>& footprints, const CoverageOptions& options) {
  Coverage coverage;
  if (footprints.empty()) return coverage;
  std::vector<double> sides, areas;
  Eigen::Vector2d low = footprints[0].corners[0].head<2>(), high = low;
  for (const Footprint& footprint : footprints) {
    sides.push_back(std::min(footprint.Length(), footprint.Width()));
    areas.push_back(footprint.Area());
    for (const Eigen::Vector3d& corner : footprint.corners) {
      low = low.cwiseMin(corner.head<2>());
      high = high.cwiseMax(corner.head<2>());
    }
  }
  const double side = Median(sides);
  if (!(side > 0)) return coverage;
  coverage.cell = std::max(side / options.cells_per_footprint, (high - low).maxCoeff() / (kMaxSide - 2));
  const int margin = static_cast<int>(side / coverage.cell) + 2;  // so that growing does not meet the border
  coverage.corner = low - coverage.cell * Eigen::Vector2d(margin, margin);
  coverage.width = static_cast<int>((high.x() - low.x()) / coverage.cell) + 1 + 2 * margin;
  coverage.height = static_cast<int>((high.y() - low.y()) / coverage.cell) + 1 + 2 * margin;
  coverage.counts.assign(static_cast<size_t>(coverage.width) * coverage.height, 0);
  for (const Footprint& footprint : footprints) CountFootprint(footprint, &coverage);
  Mask outline(coverage.width, coverage.height);
  const double cell_area = coverage.cell * coverage.cell;
  for (int y = 0; y < coverage.height; ++y) {
    for (int x = 0; x < coverage.width; ++x) {
      const int count = coverage.Count(x, y);
      outline.At(x, y) = count > 0;
      if (count > 0) coverage.area_seen += cell_area;
      if (count >= options.min_images) coverage.area_enough += cell_area;
    }
  }
  coverage.area_few = coverage.area_seen - coverage.area_enough;
  const int half = std::max(1, static_cast<int>(0.5 * side / coverage.cell));
  Mask without_holes = outline;
  FillEnclosed(coverage, &without_holes);
  outline = outline.Grown(half).Grown(-half);
  FillEnclosed(coverage, &outline);
  Mask open = outline.Grown(-half);
  for (int y = 0; y < coverage.height; ++y) {
    for (int x = 0; x < coverage.width; ++x) {
      // What is seen all around is open at the edge, too.
      const bool is_inside = open.Has(x, y) || (coverage.Count(x, y) == 0 && without_holes.Has(x, y));
      open.At(x, y) = is_inside && coverage.Count(x, y) < options.min_images;
    }
  }
  FindRegions(options.smallest_region * Median(areas), open, &coverage);
  return coverage;
}

}  // namespace mapmend
