#include "libs/drawing/canvas.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdio>
#include <utility>

namespace mapmend {

std::string CategoryColor(int index) {
  static constexpr std::array<const char*, 9> kChosen = {"#0072b2", "#d55e00", "#009e73", "#cc79a7", "#56b4e9",
                                                         "#e69f00", "#4b3a8c", "#7d2a1a", "#5f6b76"};
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

std::string InkOn(const std::string& color) {
  // Relative luminance and contrast as WCAG 2.1 has them.
  double luminance = 0;
  for (const auto& [at, share] : {std::pair{1, 0.2126}, {3, 0.7152}, {5, 0.0722}}) {
    const double value = static_cast<double>(std::stoul(color.substr(static_cast<size_t>(at), 2), nullptr, 16)) / 255;
    luminance += share * (value <= 0.03928 ? value / 12.92 : std::pow((value + 0.055) / 1.055, 2.4));
  }
  const double with_white = 1.05 / (luminance + 0.05), with_black = (luminance + 0.05) / 0.05;
  return with_white >= with_black ? "#ffffff" : "#000000";
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
