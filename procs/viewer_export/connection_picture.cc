#include "procs/viewer_export/connection_picture.h"

#include <algorithm>
#include <cmath>
#include <opencv2/core.hpp>
#include <opencv2/imgcodecs.hpp>
#include <opencv2/imgproc.hpp>

#include "libs/map_view/image_pixels.h"
#include "libs/map_view/keyframe_pixels.h"
#include "procs/viewer_export/connection_matches.h"

namespace mapmend {
namespace {

constexpr int kGap = 6, kHeading = 30;  // pixels
constexpr int kJpegQuality = 80;
constexpr int kFractionBits = 4;  // of coordinates in drawing
const cv::Scalar kGreen(80, 220, 60), kOrange(0, 140, 255), kPaper(255, 255, 255), kDark(40, 40, 40),
    kNone(200, 200, 200);

// One of the two keyframes as it is drawn.
struct Half {
  cv::Mat picture;
  double scale = 1;  // picture pixels per pixel of the image
  Camera camera;
  Pinhole ideal;
  int width = 0, height = 0;  // of the image
  bool is_missing = false;

  Eigen::Vector2d Place(const Eigen::Vector2f& pixel) const {
    const Eigen::Vector2d p = ImagePixels(camera, ideal, width, height).FromIdeal(pixel.cast<double>());
    return {scale * (p.x() + 0.5) - 0.5, scale * (p.y() + 0.5) - 0.5};
  }
};

Half MakeHalf(const MapModel& model, const SubmapKey& key, KeyframeId id, const FetchImage& fetch, int height) {
  const SessionStarted& session = model.GetSession(key.session).info;
  Half half;
  half.camera = session.camera;
  half.ideal = session.pinhole;
  cv::Mat image;
  if (fetch) {
    if (const auto stored = fetch(key.session, id)) image = DecodePixels(*stored);
  }
  const bool is_missing = image.empty();
  if (is_missing) {
    half.is_missing = true;
    image = cv::Mat(session.pinhole.height, session.pinhole.width, CV_8UC3, kNone);
  }
  half.width = image.cols;
  half.height = image.rows;
  half.scale = static_cast<double>(height) / image.rows;
  cv::resize(image, half.picture, {std::max(1, static_cast<int>(std::lround(half.scale * image.cols))), height}, 0, 0,
             half.scale < 1 ? cv::INTER_AREA : cv::INTER_LINEAR);
  return half;
}

// For a person: which submap, which frame.
std::string Label(const Snapshot& snapshot, const SubmapKey& key, KeyframeId id, const Half& half) {
  const SnapshotSubmap& submap = snapshot.submaps[static_cast<size_t>(snapshot.FindSubmap(key))];
  std::string label = "submap " + std::to_string(submap.number);
  if (const auto keyframe = submap.submap->keyframes.find(id); keyframe != submap.submap->keyframes.end())
    label += ", frame " + std::to_string(keyframe->second.frame);
  return label + (half.is_missing ? " (image missing)" : "");
}

cv::Point Fixed(const Eigen::Vector2d& p) {
  return {static_cast<int>(std::lround(p.x() * (1 << kFractionBits))),
          static_cast<int>(std::lround(p.y() * (1 << kFractionBits)))};
}

void Write(cv::Mat* canvas, const std::string& text, int x, int width) {
  constexpr int kFont = cv::FONT_HERSHEY_SIMPLEX;
  int baseline = 0;
  double size = 0.55;
  const int needed = cv::getTextSize(text, kFont, size, 1, &baseline).width;
  if (needed > width) size *= static_cast<double>(width) / needed;
  cv::putText(*canvas, text, {x, kHeading - 9}, kFont, size, kDark, 1, cv::LINE_AA);
}

}  // namespace

std::vector<uint8_t> DrawConnection(const Snapshot& snapshot, const EvaluatedConnection& connection,
                                    const PictureSource& source, const ConnectionPictureOptions& options) {
  const auto matched = MatchConnection(snapshot, connection, source.keyframe);
  if (!matched) return {};
  const Half a = MakeHalf(*snapshot.model, connection.a, matched->a, source.image, options.height);
  const Half b = MakeHalf(*snapshot.model, connection.b, matched->b, source.image, options.height);
  const int left = a.picture.cols, width = left + kGap + b.picture.cols;
  cv::Mat canvas(kHeading + options.height, width, CV_8UC3, kPaper);
  a.picture.copyTo(canvas(cv::Rect(0, kHeading, left, options.height)));
  b.picture.copyTo(canvas(cv::Rect(left + kGap, kHeading, b.picture.cols, options.height)));
  const size_t n = matched->matches.size();
  Write(&canvas,
        Label(snapshot, connection.a, matched->a, a) + ": " + std::to_string(n) +
            (matched->are_inliers ? " points found in both" : " matches, not confirmed"),
        6, left - 12);
  Write(&canvas, Label(snapshot, connection.b, matched->b, b), left + kGap + 6, b.picture.cols - 12);
  const cv::Scalar color = matched->are_inliers ? kGreen : kOrange;
  const int radius = std::max(2, options.height / 240);
  for (const auto& [in_a, in_b] : matched->matches) {
    const Eigen::Vector2d p = a.Place(in_a) + Eigen::Vector2d(0, kHeading),
                          q = b.Place(in_b) + Eigen::Vector2d(left + kGap, kHeading);
    cv::line(canvas, Fixed(p), Fixed(q), color, 1, cv::LINE_AA, kFractionBits);
    for (const Eigen::Vector2d& end : {p, q})
      cv::circle(canvas, Fixed(end), radius << kFractionBits, color, 1, cv::LINE_AA, kFractionBits);
  }
  std::vector<uint8_t> bytes;
  if (options.encoding == "png") {
    cv::imencode(".png", canvas, bytes);
  } else {
    cv::imencode(".jpg", canvas, bytes, {cv::IMWRITE_JPEG_QUALITY, kJpegQuality});
  }
  return bytes;
}

std::vector<uint8_t> DrawKeyframe(const MapModel& model, const SubmapKey& key, KeyframeId id, const FetchImage& image,
                                  int height, bool with_features) {
  const auto& submaps = model.GetSession(key.session).submaps;
  const auto submap = submaps.find(key.submap);
  if (submap == submaps.end()) return {};
  const auto keyframe = submap->second.keyframes.find(id);
  if (keyframe == submap->second.keyframes.end()) return {};
  Half half = MakeHalf(model, key, id, image, height);
  const auto& keypoints = keyframe->second.features.keypoints;
  const auto& points = keyframe->second.map_points;
  for (size_t i = 0; with_features && i < keypoints.size(); ++i) {
    const bool sees_point = i < points.size() && points[i].IsValid();
    cv::circle(half.picture, Fixed(half.Place(keypoints[i].pixel)), (sees_point ? 4 : 1) << kFractionBits,
               sees_point ? kGreen : kNone, sees_point ? 2 : 1, cv::LINE_AA, kFractionBits);
  }
  std::vector<uint8_t> bytes;
  cv::imencode(".jpg", half.picture, bytes, {cv::IMWRITE_JPEG_QUALITY, kJpegQuality});
  return bytes;
}

}  // namespace mapmend
