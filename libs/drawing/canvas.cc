#include "libs/drawing/canvas.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdio>

namespace mapmend {

std::string CategoryColor(int index) {
  static constexpr std::array<const char*, 10> kChosen = {"#2f6fde", "#e8710a", "#2a9d4b", "#b5379f", "#12a5b8",
                                                          "#8a5a2b", "#7a52d1", "#c9a100", "#4c6680", "#5b8c00"};
  index = std::max(index, 0);
  if (index < static_cast<int>(kChosen.size())) return kChosen[index];
  // Hues a golden angle apart never repeat; three lightnesses keep neighbours in hue apart. HSL to RGB with saturation
  // 0.6.
  const double hue = std::fmod(0.13 + 0.381966 * index, 1.0) * 6.0;
  const double lightness = std::array<double, 3>{0.42, 0.55, 0.33}[index % 3];
  const double chroma = (1 - std::abs(2 * lightness - 1)) * 0.6;
  const double second = chroma * (1 - std::abs(std::fmod(hue, 2.0) - 1));
  const std::array<std::array<double, 3>, 6> sextants = {{{chroma, second, 0},
                                                          {second, chroma, 0},
                                                          {0, chroma, second},
                                                          {0, second, chroma},
                                                          {second, 0, chroma},
                                                          {chroma, 0, second}}};
  const std::array<double, 3>& rgb = sextants[static_cast<int>(hue) % 6];
  char text[8];
  const auto byte = [&](double v) {
    return static_cast<unsigned>(std::lround(255 * (v + lightness - chroma / 2))) & 255u;
  };
  std::snprintf(text, sizeof(text), "#%02x%02x%02x", byte(rgb[0]), byte(rgb[1]), byte(rgb[2]));
  return text;
}

double EstimateTextWidth(const std::string& text, double font_size) {
  double ems = 0;
  for (const char c : text) {
    if ((c & 0xC0) == 0x80) continue;  // continuation byte of UTF-8
    ems += std::string_view("iljtf.,:;|!' ()[]").find(c) != std::string_view::npos ? 0.32 : 0.57;
  }
  return ems * font_size;
}

}  // namespace mapmend
