#include "procs/viewer_export/colmap_export.h"

#include <filesystem>
#include <opencv2/core.hpp>
#include <opencv2/imgcodecs.hpp>
#include <opencv2/imgproc.hpp>
#include <set>
#include <stdexcept>
#include <tuple>
#include <utility>

#include "libs/base/write_file.h"
#include "libs/map_view/image_pixels.h"
#include "libs/map_view/keyframe_pixels.h"
#include "procs/viewer_export/colmap_model.h"

namespace mapmend {
namespace {

namespace fs = std::filesystem;

constexpr int kUndistortedQuality = 95;  // of JPEG

void MakeFolder(const fs::path& folder) {
  std::error_code error;
  fs::create_directories(folder, error);
  if (error) throw std::runtime_error("cannot create the directory " + folder.string() + ": " + error.message());
}

// For a lens of which COLMAP has no model: the image as the ideal camera would have taken it. False if it cannot be
// decoded.
bool Undistort(const Camera& camera, KeyframeImage* image) {
  const cv::Mat taken = DecodePixels(*image);
  if (taken.empty()) return false;
  const Camera resized = camera.Resized(taken.cols, taken.rows);
  const Pinhole ideal = resized.Ideal();
  cv::Mat map(taken.rows, taken.cols, CV_32FC2), straight;
  for (int y = 0; y < map.rows; ++y) {
    for (int x = 0; x < map.cols; ++x) {
      const Eigen::Vector2d pixel = resized.Project(ideal.Unproject({x, y}));
      map.at<cv::Vec2f>(y, x) = {static_cast<float>(pixel.x()), static_cast<float>(pixel.y())};
    }
  }
  cv::remap(taken, straight, map, {}, cv::INTER_LINEAR);
  image->encoding = "jpeg";
  return cv::imencode(".jpg", straight, image->bytes, {cv::IMWRITE_JPEG_QUALITY, kUndistortedQuality});
}

std::string AsText(const std::vector<uint8_t>& bytes) { return {bytes.begin(), bytes.end()}; }

// Those of an earlier export that are not written any more.
void RemoveOthers(const fs::path& folder, const std::set<std::string>& names) {
  std::error_code error;
  std::vector<fs::path> others;
  for (fs::recursive_directory_iterator entry(folder, error), end; !error && entry != end; entry.increment(error)) {
    const std::string name = fs::relative(entry->path(), folder, error).generic_string();
    if (entry->is_regular_file(error) && entry->path().filename().string().starts_with("frame_") &&
        !names.contains(name))
      others.push_back(entry->path());
  }
  for (const fs::path& path : others) fs::remove(path, error);
}

ColmapPictures WritePictures(const Snapshot& snapshot, int component, const FetchImage& fetch, const fs::path& folder) {
  ColmapPictures pictures;
  std::set<std::string> names;
  for (const SnapshotKeyframe& placed : snapshot.components[component].keyframes) {
    const SnapshotSubmap& submap = snapshot.submaps[placed.submap];
    std::optional<KeyframeImage> image;
    if (fetch) image = fetch(submap.key.session, placed.id);
    if (!image) continue;
    const SessionStarted& session = snapshot.model->GetSession(submap.key.session).info;
    const Camera camera = LensOf(session.camera, session.pinhole);
    if (!ToColmapCamera(camera) && !Undistort(camera, &*image)) continue;
    const int frame = submap.submap->keyframes.at(placed.id).frame;
    ColmapPicture picture{ColmapPictureName(submap.session, frame, ImageSuffix(image->encoding)), image->width,
                          image->height};
    const fs::path path = folder / picture.name;
    MakeFolder(path.parent_path());
    WriteFile(path.string(), AsText(image->bytes));
    names.insert(picture.name);
    pictures[{submap.key.session, placed.id}] = std::move(picture);
  }
  RemoveOthers(folder, names);
  return pictures;
}

}  // namespace

ColmapImages ExportColmap(const Snapshot& snapshot, int component, const FetchImage& fetch, const std::string& folder) {
  const fs::path dir = folder, sparse = dir / "sparse" / "0";
  MakeFolder(dir);
  MakeFolder(sparse);
  const ColmapPictures pictures = WritePictures(snapshot, component, fetch, dir / "images");
  const ColmapModel model = MakeColmapModel(snapshot, component, pictures);
  for (const auto& [files, place, suffix] :
       {std::tuple(ToColmapText(model), dir, ".txt"), std::tuple(ToColmapBinary(model), sparse, ".bin")}) {
    WriteFile((place / ("cameras" + std::string(suffix))).string(), files.cameras);
    WriteFile((place / ("images" + std::string(suffix))).string(), files.images);
    WriteFile((place / ("points3D" + std::string(suffix))).string(), files.points);
  }
  const int written = static_cast<int>(pictures.size());
  return {written, static_cast<int>(model.images.size()) - written};
}

}  // namespace mapmend
