#include "libs/formats/las.h"

#include <algorithm>
#include <chrono>
#include <cmath>

#include "libs/formats/little_endian.h"
#include "libs/formats/wkt.h"

namespace mapmend {
namespace {

constexpr uint16_t kHeaderSize = 375, kPointSize = 36;
constexpr uint8_t kPointFormat = 7;
constexpr uint16_t kReturnsAreSynthetic = 1 << 3, kHasWkt = 1 << 4;  // of "global encoding"

// Coordinates of the file: (coordinate - offset) / scale, rounded.
struct Grid {
  Eigen::Vector3d low = Eigen::Vector3d::Zero(), high = Eigen::Vector3d::Zero(), offset = Eigen::Vector3d::Zero();
  double scale = 0.001;

  int32_t Index(double value, int axis) const {
    return static_cast<int32_t>(std::llround((value - offset[axis]) / scale));
  }
};

Grid MakeGrid(const PlacedMap& map) {
  Grid grid;
  if (map.points.empty()) return grid;
  grid.low = grid.high = map.points.front().position;
  for (const PlacedPoint& point : map.points) {
    grid.low = grid.low.cwiseMin(point.position);
    grid.high = grid.high.cwiseMax(point.position);
  }
  // A power of ten, a millionth of the extent: far finer than the map, far from the limits of the integers.
  const double extent = std::max((grid.high - grid.low).maxCoeff(), 1e-6);
  grid.scale = std::pow(10, std::floor(std::log10(extent)) - 6);
  if (map.frame.unit == "m") grid.scale = std::min(grid.scale, 0.001);
  grid.offset = (map.frame.origin + (grid.low + grid.high) / 2).array().round();
  // As the integers tell them: the bounds must agree with what a reader computes.
  for (int axis = 0; axis < 3; ++axis) {
    for (double* bound : {&grid.low[axis], &grid.high[axis]})
      *bound = grid.offset[axis] + grid.scale * grid.Index(*bound + map.frame.origin[axis], axis);
  }
  return grid;
}

void AppendDate(const PlacedMap& map, std::string* bytes) {
  using std::chrono::days;
  const int64_t utime = map.frames.empty() ? 0 : map.frames.front().utime;
  const std::chrono::sys_days day{days(utime / 86400000000)};
  const std::chrono::year year = std::chrono::year_month_day(day).year();
  const auto first = std::chrono::sys_days(year / 1 / 1);
  Append(static_cast<uint16_t>((day - first).count() + 1), bytes);
  Append(static_cast<uint16_t>(static_cast<int>(year)), bytes);
}

std::string ReferenceSystem(int epsg) {
  if (epsg == 0) return {};
  const std::string text = WellKnownText(epsg);
  std::string record;
  Append(uint16_t{0}, &record);
  AppendPadded("LASF_Projection", 16, &record);
  Append(uint16_t{2112}, &record);
  Append(static_cast<uint16_t>(text.size() + 1), &record);
  AppendPadded("OGC WKT", 32, &record);
  return record + text + '\0';
}

std::string Header(const PlacedMap& map, const Grid& grid, const std::string& reference_system) {
  std::string h = "LASF";
  Append(uint16_t{0}, &h);
  Append(static_cast<uint16_t>(kReturnsAreSynthetic | kHasWkt), &h);  // format 7 knows no other way than WKT
  h.append(16, '\0');                                                 // project id
  Append(uint8_t{1}, &h);
  Append(uint8_t{4}, &h);
  AppendPadded(map.frame.unit == "m" ? "images" : "images, unit arbitrary", 32, &h);
  AppendPadded("mapmend " MAPMEND_VERSION, 32, &h);
  AppendDate(map, &h);
  Append(kHeaderSize, &h);
  Append(static_cast<uint32_t>(kHeaderSize + reference_system.size()), &h);
  Append(uint32_t{reference_system.empty() ? 0U : 1U}, &h);
  Append(kPointFormat, &h);
  Append(kPointSize, &h);
  h.append(6 * sizeof(uint32_t), '\0');  // counts of older versions, which have no such format
  for (int i = 0; i < 3; ++i) Append(grid.scale, &h);
  for (int i = 0; i < 3; ++i) Append(grid.offset[i], &h);
  for (int i = 0; i < 3; ++i) {
    Append(grid.high[i], &h);
    Append(grid.low[i], &h);
  }
  h.append(2 * sizeof(uint64_t) + sizeof(uint32_t), '\0');  // waveforms, extended records: none
  const uint64_t count = map.points.size();
  Append(count, &h);
  Append(count, &h);  // all are first returns
  h.append(14 * sizeof(uint64_t), '\0');
  return h;
}

void AppendPoint(const PlacedMap& map, const Grid& grid, const PlacedPoint& point, std::string* bytes) {
  for (int axis = 0; axis < 3; ++axis) Append(grid.Index(point.position[axis] + map.frame.origin[axis], axis), bytes);
  Append(uint16_t{0}, bytes);    // intensity
  Append(uint8_t{0x11}, bytes);  // return 1 of 1
  Append(uint8_t{0}, bytes);     // flags
  Append(uint8_t{0}, bytes);     // class: never classified
  Append(static_cast<uint8_t>(std::clamp(point.num_images, 0, 255)), bytes);
  Append(int16_t{0}, bytes);  // scan angle
  Append(static_cast<uint16_t>(map.submaps[point.submap].number), bytes);
  Append(0.0, bytes);  // time
  for (const uint8_t c : point.color) Append(static_cast<uint16_t>(c * 257), bytes);
}

}  // namespace

std::string PointsLas(const PlacedMap& map) {
  const Grid grid = MakeGrid(map);
  const std::string reference_system = ReferenceSystem(map.frame.epsg);
  std::string bytes = Header(map, grid, reference_system) + reference_system;
  bytes.reserve(bytes.size() + kPointSize * map.points.size());
  for (const PlacedPoint& point : map.points) AppendPoint(map, grid, point, &bytes);
  return bytes;
}

}  // namespace mapmend
