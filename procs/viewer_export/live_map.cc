#include "procs/viewer_export/live_map.h"

#include <algorithm>
#include <array>
#include <charconv>
#include <cstring>

namespace mapmend {
namespace {

constexpr size_t kMostPoints = 600000;  // that are shown; a page draws no more in time
// A point that moved by less of its distance from the camera is not sent again: less than a pixel.
constexpr float kVisibleMove = 0.001F;

// Rows are little-endian, as is every machine that this runs on.
class RowBytes {
 public:
  template <typename T>
  RowBytes& Add(T value) {
    char raw[sizeof(T)];
    std::memcpy(raw, &value, sizeof(T));
    bytes_.append(raw, sizeof(T));
    return *this;
  }
  RowBytes& Add(const Eigen::Vector3f& v) { return Add(v.x()).Add(v.y()).Add(v.z()); }
  const std::string& bytes() const { return bytes_; }

 private:
  std::string bytes_;
};

float SecondsSince(int64_t start_utime, int64_t utime) {
  return static_cast<float>(1e-6 * static_cast<double>(utime - start_utime));
}

// Mean over the images that see it; grey without.
std::array<uint8_t, 3> ColorOf(const Submap& submap, const SubmapPoint& point) {
  std::array<int, 3> sum = {0, 0, 0};
  int n = 0;
  for (const SubmapObservation& observation : point.observations) {
    const auto keyframe = submap.keyframes.find(observation.keyframe);
    if (keyframe == submap.keyframes.end() || keyframe->second.features.colors.empty()) continue;
    const auto& color = keyframe->second.features.colors[static_cast<size_t>(observation.feature)];
    for (size_t c = 0; c < 3; ++c) sum[c] += color[c];
    ++n;
  }
  std::array<uint8_t, 3> color = {160, 160, 160};
  for (size_t c = 0; c < 3 && n > 0; ++c) color[c] = static_cast<uint8_t>(sum[c] / n);
  return color;
}

}  // namespace

std::string PageKey(const MapModel& model, const SubmapKey& key) {
  const auto& order = model.SessionOrder();
  const auto it = std::find(order.begin(), order.end(), key.session);
  return std::to_string(it - order.begin()) + ":" + std::to_string(key.submap.value);
}

SubmapKey ParsePageKey(const MapModel& model, const std::string& text) {
  size_t session = 0;
  int submap = -1;
  const char* end = text.data() + text.size();
  const auto [colon, problem] = std::from_chars(text.data(), end, session);
  if (problem != std::errc() || colon == end || *colon != ':' || session >= model.SessionOrder().size()) return {};
  const auto [stop, error] = std::from_chars(colon + 1, end, submap);
  if (error != std::errc() || stop != end || submap < 0) return {};
  return {model.SessionOrder()[session], SubmapId(submap)};
}

void LiveMap::OnKeyframe(const KeyframeRecord& record, float t, PageSubmap* page) {
  const auto [it, is_new] =
      page->keyframe_rows.try_emplace(record.keyframe, static_cast<uint32_t>(page->keyframe_of_row.size()));
  if (is_new) page->keyframe_of_row.push_back(record.keyframe);
  page->dirty_keyframes.insert(record.keyframe);
  for (const MapPointId id : record.map_points) {
    if (!id.IsValid()) continue;
    if (const auto known = page->points.find(id); known != page->points.end()) continue;
    if (num_points_ >= kMostPoints) return;
    page->points[id] = {static_cast<uint32_t>(page->points.size()), t, Eigen::Vector3f::Zero(), false, false};
    page->dirty_points.insert(id);
    ++num_points_;
  }
}

void LiveMap::OnUpdate(const MapUpdate& update, PageSubmap* page) {
  for (const KeyframePose& pose : update.keyframes) {
    page->dirty_keyframes.insert(pose.keyframe);
    page->refined_keyframes.erase(pose.keyframe);
  }
  for (const KeyframeId id : update.removed_keyframes) page->dirty_keyframes.insert(id);
  if (!update.removed_keyframes.empty()) page->resend_frames = true;
  for (const PointPosition& point : update.points) {
    page->dirty_points.insert(point.point);
    page->refined_points.erase(point.point);
  }
  page->dirty_points.insert(update.removed_points.begin(), update.removed_points.end());
}

void LiveMap::OnRecord(const Record& record, const MapModel& model) {
  const std::string& session = record.header.session;
  if (const auto* keyframe = std::get_if<KeyframeRecord>(&record.body)) {
    const SubmapKey key = {session, keyframe->submap};
    OnKeyframe(*keyframe, SecondsSince(model.GetSession(session).start_utime, record.header.utime), &submaps_[key]);
    dirty_.insert(key);
  } else if (const auto* update = std::get_if<MapUpdate>(&record.body)) {
    const SubmapKey key = {session, update->submap};
    PageSubmap& page = submaps_[key];
    // A point may be told before or after the keyframe that sees it.
    for (const PointPosition& point : update->points) {
      if (page.points.contains(point.point) || num_points_ >= kMostPoints) continue;
      const float t = SecondsSince(model.GetSession(session).start_utime, record.header.utime);
      page.points[point.point] = {static_cast<uint32_t>(page.points.size()), t, Eigen::Vector3f::Zero(), false, false};
      ++num_points_;
    }
    OnUpdate(*update, &page);
    dirty_.insert(key);
  }
}

void LiveMap::TakeRefined(const Submap& submap, const RefinedSubmap& refined, const Similarity3& root_from_submap,
                          PageSubmap* page) {
  const Similarity3 submap_from_root = root_from_submap.Inverse();
  for (const RefinedSubmap::Keyframe& keyframe : refined.keyframes) {
    page->refined_keyframes[keyframe.id] = TransformWorld(keyframe.cam_from_root, submap_from_root);
    page->dirty_keyframes.insert(keyframe.id);
  }
  if (refined.points.empty()) return;
  for (const RefinedSubmap::Point& point : refined.points)
    page->refined_points[point.id] = (submap_from_root * point.position.cast<double>()).cast<float>();
  for (auto& [id, point] : page->points) {
    const bool is_hidden = submap.points.contains(id) && !page->refined_points.contains(id);
    if (is_hidden || point.is_hidden || page->refined_points.contains(id)) page->dirty_points.insert(id);
    point.is_hidden = is_hidden;
  }
}

void LiveMap::OnRevision(const MapModel& model) {
  const MapRevision& revision = model.Revision();
  for (const RefinedSubmap& refined : revision.refined) {
    const auto place = std::find_if(revision.transforms.submaps.begin(), revision.transforms.submaps.end(),
                                    [&](const MergedTransforms::Place& p) { return p.key == refined.key; });
    const auto page = submaps_.find(refined.key);
    if (place == revision.transforms.submaps.end() || page == submaps_.end()) continue;
    const Submap& submap = model.GetSession(refined.key.session).submaps.at(refined.key.submap);
    page->second.refined_keyframes.clear();
    page->second.refined_points.clear();
    TakeRefined(submap, refined, place->root_from_submap, &page->second);
    dirty_.insert(refined.key);
  }
}

void LiveMap::PublishPoints(const std::string& name, const Submap& submap, PageSubmap* page, LiveFeed* feed) {
  Eigen::Vector3f camera = Eigen::Vector3f::Zero();
  if (!submap.keyframes.empty()) camera = submap.keyframes.rbegin()->second.cam_from_submap.Center().cast<float>();
  for (const MapPointId id : page->dirty_points) {
    const auto known = page->points.find(id);
    if (known == page->points.end()) continue;
    PagePoint& point = known->second;
    const auto in_map = submap.points.find(id);
    const bool is_shown = in_map != submap.points.end() && !point.is_hidden;
    if (!is_shown && !point.is_published) continue;
    std::array<uint8_t, 3> color = {};
    if (is_shown) {
      const auto refined = page->refined_points.find(id);
      const Eigen::Vector3f position =
          refined == page->refined_points.end() ? in_map->second.position : refined->second;
      const float distance = (position - camera).norm();
      if (point.is_published && (position - point.position).norm() < kVisibleMove * distance) continue;
      point.position = position;
      color = ColorOf(submap, in_map->second);
    }
    RowBytes row;
    row.Add(point.position).Add(point.t);
    for (const uint8_t c : color) row.Add(c);
    row.Add(static_cast<uint8_t>(is_shown));
    feed->SetRow(name, point.row, row.bytes());
    point.is_published = is_shown;
  }
  page->dirty_points.clear();
}

void LiveMap::PublishKeyframes(const std::string& name, const Session& session, const Submap& submap, PageSubmap* page,
                               LiveFeed* feed) {
  for (const KeyframeId id : page->dirty_keyframes) {
    const auto row = page->keyframe_rows.find(id);
    if (row == page->keyframe_rows.end()) continue;
    const auto keyframe = submap.keyframes.find(id);
    const bool is_shown = keyframe != submap.keyframes.end();
    RowBytes bytes;
    bytes.Add(id.value);
    if (is_shown) {
      const auto refined = page->refined_keyframes.find(id);
      const Rigid3& pose =
          refined == page->refined_keyframes.end() ? keyframe->second.cam_from_submap : refined->second;
      bytes.Add(keyframe->second.frame).Add(SecondsSince(session.start_utime, keyframe->second.utime));
      for (const double number : ToArray(pose)) bytes.Add(static_cast<float>(number));
    } else {
      bytes.Add(int32_t{-1}).Add(0.0F);
      for (const double number : ToArray(Rigid3())) bytes.Add(static_cast<float>(number));
    }
    bytes.Add(static_cast<uint32_t>(is_shown));
    feed->SetRow(name, row->second, bytes.bytes());
  }
  page->dirty_keyframes.clear();
}

void LiveMap::PublishFrames(const std::string& name, const Session& session, const Submap& submap, PageSubmap* page,
                            LiveFeed* feed) {
  for (size_t i = page->resend_frames ? 0 : page->num_frames_published; i < submap.frames.size(); ++i) {
    const TrackedFrame frame = submap.Resolved(submap.frames[i]);
    const auto row = page->keyframe_rows.find(frame.keyframe);
    if (row == page->keyframe_rows.end()) continue;
    RowBytes bytes;
    bytes.Add(int32_t{frame.frame}).Add(SecondsSince(session.start_utime, frame.utime)).Add(row->second);
    bytes.Add(Eigen::Vector3f(frame.cam_from_keyframe.Center().cast<float>()));
    feed->SetRow(name, static_cast<uint32_t>(i), bytes.bytes());
  }
  page->num_frames_published = submap.frames.size();
  page->resend_frames = false;
}

bool LiveMap::Publish(const MapModel& model, LiveFeed* feed) {
  const int64_t before = feed->Version();
  for (const SubmapKey& key : dirty_) {
    const Session& session = model.GetSession(key.session);
    const auto submap = session.submaps.find(key.submap);
    if (submap == session.submaps.end()) continue;
    PageSubmap& page = submaps_[key];
    const std::string name = PageKey(model, key);
    PublishKeyframes("keyframes/" + name, session, submap->second, &page, feed);
    PublishFrames("frames/" + name, session, submap->second, &page, feed);
    PublishPoints("points/" + name, submap->second, &page, feed);
  }
  dirty_.clear();
  return feed->Version() != before;
}

}  // namespace mapmend
