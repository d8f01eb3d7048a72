#include "libs/drawing/svg_canvas.h"

#include <cstdio>

namespace mapmend {
namespace {

// Two decimals, without trailing zeros: a hundredth of a pixel, and small files.
std::string Number(double value) {
  char text[64];
  std::snprintf(text, sizeof(text), "%.2f", value);
  std::string result = text;
  result.erase(result.find_last_not_of('0') + 1);
  if (result.back() == '.') result.pop_back();
  return result == "-0" ? "0" : result;
}

std::string Attribute(const char* name, double value) { return std::string(" ") + name + "=\"" + Number(value) + "\""; }

std::string StrokeAttributes(const Canvas::Stroke& stroke) {
  if (stroke.color.empty()) return "";
  std::string text = " stroke=\"" + stroke.color + "\"" + Attribute("stroke-width", stroke.width);
  if (stroke.dashed) text += " stroke-dasharray=\"" + Number(4 * stroke.width) + " " + Number(3 * stroke.width) + "\"";
  return text;
}

std::string FillAttribute(const std::string& fill) { return " fill=\"" + (fill.empty() ? "none" : fill) + "\""; }

}  // namespace

std::string EscapeXml(const std::string& text) {
  std::string result;
  for (const char c : text) {
    switch (c) {
      case '&':
        result += "&amp;";
        break;
      case '<':
        result += "&lt;";
        break;
      case '>':
        result += "&gt;";
        break;
      case '"':
        result += "&quot;";
        break;
      case '\'':
        result += "&#39;";
        break;
      default:
        result += static_cast<unsigned char>(c) < 0x20 ? ' ' : c;
    }
  }
  return result;
}

SvgCanvas::SvgCanvas(double width, double height) : width_(width), height_(height) {}

void SvgCanvas::DrawPolyline(const std::vector<Eigen::Vector2d>& points, const Stroke& stroke) {
  if (points.empty() || stroke.color.empty()) return;
  body_ += "<polyline fill=\"none\" stroke-linejoin=\"round\" stroke-linecap=\"round\"" + StrokeAttributes(stroke) +
           " points=\"";
  for (size_t i = 0; i < points.size(); ++i) {
    if (i > 0) body_ += ' ';
    body_ += Number(points[i].x()) + "," + Number(points[i].y());
  }
  body_ += "\"/>\n";
}

void SvgCanvas::DrawCircle(const Eigen::Vector2d& center, double radius, const std::string& fill,
                           const Stroke& stroke) {
  body_ += "<circle" + Attribute("cx", center.x()) + Attribute("cy", center.y()) + Attribute("r", radius) +
           FillAttribute(fill) + StrokeAttributes(stroke) + "/>\n";
}

void SvgCanvas::DrawRectangle(const Eigen::Vector2d& top_left, const Eigen::Vector2d& size, double corner_radius,
                              const std::string& fill, const Stroke& stroke) {
  body_ += "<rect" + Attribute("x", top_left.x()) + Attribute("y", top_left.y()) + Attribute("width", size.x()) +
           Attribute("height", size.y());
  if (corner_radius > 0) body_ += Attribute("rx", corner_radius);
  body_ += FillAttribute(fill) + StrokeAttributes(stroke) + "/>\n";
}

void SvgCanvas::DrawText(const Eigen::Vector2d& at, const std::string& text, const Font& font) {
  body_ += "<text" + Attribute("x", at.x()) + Attribute("y", at.y()) + Attribute("font-size", font.size) +
           FillAttribute(font.color);
  if (font.anchor != Anchor::kStart) {
    body_ += font.anchor == Anchor::kMiddle ? " text-anchor=\"middle\"" : " text-anchor=\"end\"";
  }
  if (font.bold) body_ += " font-weight=\"600\"";
  body_ += '>';
  body_ += EscapeXml(text);
  body_ += "</text>\n";
}

void SvgCanvas::BeginGroup(const std::string& tooltip) { body_ += "<g><title>" + EscapeXml(tooltip) + "</title>\n"; }

void SvgCanvas::EndGroup() { body_ += "</g>\n"; }

std::string SvgCanvas::Finish(const std::string& title) const {
  const std::string w = Number(width_), h = Number(height_);
  return "<svg xmlns=\"http://www.w3.org/2000/svg\" role=\"img\" width=\"" + w + "\" height=\"" + h +
         "\" viewBox=\"0 0 " + w + " " + h +
         "\" font-family=\"system-ui, 'Segoe UI', 'DejaVu Sans', Arial, sans-serif\">\n<title>" + EscapeXml(title) +
         "</title>\n" + body_ + "</svg>\n";
}

}  // namespace mapmend
