#include "procs/mapmend/raster_canvas.h"

#include <cmath>
#include <opencv2/imgcodecs.hpp>
#include <opencv2/imgproc.hpp>
#include <stdexcept>

namespace mapmend {
namespace {

constexpr double kZoom = 2;
constexpr int kSubpixelBits = 4;
constexpr double kHersheyHeight = 30;  // pixels per unit of font scale that a Hershey font's "font size" amounts to

cv::Scalar ToScalar(const std::string& color) {
  const unsigned long rgb = std::stoul(color.substr(1), nullptr, 16);
  return cv::Scalar(static_cast<double>(rgb & 255), static_cast<double>(rgb >> 8 & 255),
                    static_cast<double>(rgb >> 16 & 255));
}

cv::Point ToPoint(const Eigen::Vector2d& p) {
  const double factor = kZoom * (1 << kSubpixelBits);
  return {static_cast<int>(std::lround(p.x() * factor)), static_cast<int>(std::lround(p.y() * factor))};
}

int Thickness(double width) { return std::max(1, static_cast<int>(std::lround(width * kZoom))); }

}  // namespace

struct RasterCanvas::Impl {
  cv::Mat image;
};

RasterCanvas::RasterCanvas(double width, double height) : impl_(std::make_unique<Impl>()) {
  impl_->image = cv::Mat(static_cast<int>(std::ceil(height * kZoom)), static_cast<int>(std::ceil(width * kZoom)),
                         CV_8UC3, cv::Scalar(255, 255, 255));
}

RasterCanvas::~RasterCanvas() = default;

void RasterCanvas::DrawPolyline(const std::vector<Eigen::Vector2d>& points, const Stroke& stroke) {
  if (stroke.color.empty()) return;
  for (size_t i = 1; i < points.size(); ++i) {
    cv::line(impl_->image, ToPoint(points[i - 1]), ToPoint(points[i]), ToScalar(stroke.color),
             stroke.dashed ? 1 : Thickness(stroke.width), cv::LINE_AA, kSubpixelBits);
  }
}

void RasterCanvas::DrawCircle(const Eigen::Vector2d& center, double radius, const std::string& fill,
                              const Stroke& stroke) {
  const int r = ToPoint({radius, 0}).x;
  if (!fill.empty())
    cv::circle(impl_->image, ToPoint(center), r, ToScalar(fill), cv::FILLED, cv::LINE_AA, kSubpixelBits);
  if (!stroke.color.empty()) {
    cv::circle(impl_->image, ToPoint(center), r, ToScalar(stroke.color), Thickness(stroke.width), cv::LINE_AA,
               kSubpixelBits);
  }
}

void RasterCanvas::DrawRectangle(const Eigen::Vector2d& top_left, const Eigen::Vector2d& size, double /*corner_radius*/,
                                 const std::string& fill, const Stroke& stroke) {
  const cv::Point a = ToPoint(top_left), b = ToPoint(top_left + size);
  if (!fill.empty()) cv::rectangle(impl_->image, a, b, ToScalar(fill), cv::FILLED, cv::LINE_8, kSubpixelBits);
  if (!stroke.color.empty()) {
    cv::rectangle(impl_->image, a, b, ToScalar(stroke.color), Thickness(stroke.width), cv::LINE_8, kSubpixelBits);
  }
}

void RasterCanvas::DrawText(const Eigen::Vector2d& at, const std::string& text, const Font& font) {
  const double scale = font.size * kZoom / kHersheyHeight;
  const int thickness = font.bold ? 2 : 1;
  const cv::Size size = cv::getTextSize(text, cv::FONT_HERSHEY_SIMPLEX, scale, thickness, nullptr);
  const double shift = font.anchor == Anchor::kStart    ? 0
                       : font.anchor == Anchor::kMiddle ? 0.5 * size.width
                                                        : size.width;
  cv::putText(impl_->image, text,
              {static_cast<int>(std::lround(at.x() * kZoom - shift)), static_cast<int>(std::lround(at.y() * kZoom))},
              cv::FONT_HERSHEY_SIMPLEX, scale, ToScalar(font.color), thickness, cv::LINE_AA);
}

void RasterCanvas::BeginGroup(const std::string& /*tooltip*/) {}

void RasterCanvas::EndGroup() {}

std::string RasterCanvas::EncodePng() const {
  std::vector<unsigned char> bytes;
  if (!cv::imencode(".png", impl_->image, bytes)) throw std::runtime_error("cannot encode the picture as PNG");
  return {bytes.begin(), bytes.end()};
}

}  // namespace mapmend
