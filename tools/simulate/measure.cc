#include "tools/simulate/measure.h"

#include <algorithm>
#include <array>
#include <nlohmann/json.hpp>
#include <opencv2/core.hpp>
#include <opencv2/features2d.hpp>
#include <opencv2/imgproc.hpp>
#include <opencv2/videoio.hpp>
#include <stdexcept>

#include "libs/features/matching.h"
#include "libs/features/orb_extractor.h"
#include "libs/geometry/camera.h"
#include "libs/geometry/trajectory_file.h"
#include "libs/retrieval/vocabulary.h"

namespace mapmend::simulate {
namespace {

struct MeasuredView {
  Rigid3 world_from_camera;
  Features features;
  BowVector bow;
};

// Where the ground seen at a pixel of one view is in the image of another; false if not in front.
bool Transfer(const Pinhole& camera, const MeasuredView& from, const MeasuredView& to, double ground,
              const Eigen::Vector2d& pixel, Eigen::Vector2d* result) {
  const Eigen::Vector3d ray = from.world_from_camera.rotation * camera.Unproject(pixel);
  if (ray.z() > -0.05) return false;
  const Eigen::Vector3d center = from.world_from_camera.translation;
  const Eigen::Vector3d there = to.world_from_camera.Inverse() * (center + ray * ((ground - center.z()) / ray.z()));
  if (there.z() <= 0) return false;
  *result = camera.Project(there);
  return true;
}

bool Inside(const Pinhole& camera, const Eigen::Vector2d& p) {
  return p.x() >= 0 && p.y() >= 0 && p.x() < camera.width && p.y() < camera.height;
}

double Overlap(const Pinhole& camera, const MeasuredView& a, const MeasuredView& b, double ground) {
  int inside = 0;
  for (int j = 0; j < 12; ++j) {
    for (int i = 0; i < 16; ++i) {
      Eigen::Vector2d there;
      const Eigen::Vector2d pixel((i + 0.5) / 16 * camera.width, (j + 0.5) / 12 * camera.height);
      inside += Transfer(camera, a, b, ground, pixel, &there) && Inside(camera, there);
    }
  }
  return inside / 192.0;
}

double RightMatches(const Pinhole& camera, const MeasuredView& a, const MeasuredView& b, double ground) {
  int common = 0, right = 0;
  std::vector<int> nearest_in_a(b.features.descriptors.size(), -1), distance_in_a(b.features.descriptors.size(), 257);
  std::vector<int> nearest_in_b(a.features.descriptors.size(), -1);
  for (size_t i = 0; i < a.features.descriptors.size(); ++i) {
    int best = 257;
    for (size_t j = 0; j < b.features.descriptors.size(); ++j) {
      const int distance = HammingDistance(a.features.descriptors[i], b.features.descriptors[j]);
      if (distance < best) best = distance, nearest_in_b[i] = static_cast<int>(j);
      if (distance < distance_in_a[j]) distance_in_a[j] = distance, nearest_in_a[j] = static_cast<int>(i);
    }
  }
  for (size_t i = 0; i < a.features.keypoints.size(); ++i) {
    Eigen::Vector2d there;
    if (!Transfer(camera, a, b, ground, a.features.keypoints[i].pixel.cast<double>(), &there) || !Inside(camera, there))
      continue;
    ++common;
    const int j = nearest_in_b[i];
    if (j < 0 || nearest_in_a[j] != static_cast<int>(i)) continue;
    right += (b.features.keypoints[j].pixel.cast<double>() - there).norm() < 0.05 * camera.width;
  }
  return common > 20 ? static_cast<double>(right) / common : -1;
}

struct Bins {
  std::vector<double> limits;
  std::vector<double> sums = std::vector<double>(limits.size(), 0);
  std::vector<int> counts = std::vector<int>(limits.size(), 0);

  void Add(double key, double value) {
    for (size_t i = 0; i < limits.size(); ++i) {
      if (key > limits[i]) continue;
      sums[i] += value;
      ++counts[i];
      return;
    }
  }
  nlohmann::ordered_json Json(const char* key) const {
    auto list = nlohmann::ordered_json::array();
    for (size_t i = 0; i < limits.size(); ++i) {
      if (counts[i] > 0)
        list.push_back({{std::string(key) + "_up_to", limits[i]}, {"mean", sums[i] / counts[i]}, {"pairs", counts[i]}});
    }
    return list;
  }
};

}  // namespace

std::string Measure(const MeasureOptions& o) {
  const Camera camera = ReadCamera(o.camera);
  const Pinhole ideal = camera.Ideal();
  const Trajectory truth = ReadTrajectory(o.truth);
  cv::VideoCapture video(o.video);
  if (!video.isOpened()) throw std::runtime_error("video " + o.video + ": cannot be opened");
  OrbOptions orb_options;
  orb_options.num_features = o.num_features;
  const OrbExtractor extractor(orb_options);
  std::vector<Vocabulary> vocabulary;
  if (!o.vocabulary.empty()) vocabulary.push_back(Vocabulary::Read(o.vocabulary));

  std::vector<MeasuredView> views;
  std::vector<double> corners, contrasts;
  cv::Mat frame, grey;
  for (size_t k = 0; k < truth.size() && video.read(frame); ++k) {
    if (k % static_cast<size_t>(o.every) != 0) continue;
    cv::cvtColor(frame, grey, cv::COLOR_BGR2GRAY);
    std::vector<cv::KeyPoint> fast;
    cv::FAST(grey, fast, 20, true);
    corners.push_back(1e6 * static_cast<double>(fast.size()) / static_cast<double>(grey.total()));
    cv::Scalar mean, deviation;
    cv::meanStdDev(grey, mean, deviation);
    contrasts.push_back(deviation[0]);
    RawFeatures raw = extractor.Extract(grey);
    MeasuredView view{truth[k].world_from_camera, {raw.keypoints, raw.descriptors, {}}, {}};
    std::vector<Eigen::Vector2f> pixels;
    for (const Keypoint& keypoint : raw.keypoints) pixels.push_back(keypoint.pixel);
    pixels = camera.Undistort(pixels);
    for (size_t i = 0; i < pixels.size(); ++i) view.features.keypoints[i].pixel = pixels[i];
    if (!vocabulary.empty()) view.bow = vocabulary[0].Transform(view.features).bow;
    views.push_back(std::move(view));
  }
  if (views.size() < 2) throw std::runtime_error("video " + o.video + ": fewer than two frames to measure");

  Bins matches{{0.15, 0.3, 0.5, 0.8}}, bow{{0.0, 0.25, 0.5, 0.75, 1.0}};
  for (size_t i = 0; i < views.size(); ++i) {
    for (size_t j = i + 1; j < views.size(); ++j) {
      const double overlap = Overlap(ideal, views[i], views[j], o.ground_height);
      if (!vocabulary.empty()) bow.Add(overlap, BowScore(views[i].bow, views[j].bow));
      const Eigen::Vector3d apart = views[i].world_from_camera.translation - views[j].world_from_camera.translation;
      const double distance = apart.norm() / (views[i].world_from_camera.translation.z() - o.ground_height);
      if (distance > 0.8 || overlap < 0.1 || j > i + 6) continue;
      const double right = RightMatches(ideal, views[i], views[j], o.ground_height);
      if (right >= 0) matches.Add(distance, right);
    }
  }
  const auto median = [](std::vector<double> values) {
    std::nth_element(values.begin(), values.begin() + static_cast<std::ptrdiff_t>(values.size() / 2), values.end());
    return values[values.size() / 2];
  };
  nlohmann::ordered_json json;
  json["frames_measured"] = views.size();
  json["fast_corners_per_megapixel"] = median(corners);
  json["grey_standard_deviation"] = median(contrasts);
  json["right_matches_by_distance_over_height"] = matches.Json("distance");
  if (!vocabulary.empty()) json["bow_score_by_overlap"] = bow.Json("overlap");
  return json.dump(2);
}

}  // namespace mapmend::simulate
