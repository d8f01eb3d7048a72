#include "procs/viewer_export/mosaic_export.h"

#include <algorithm>
#include <filesystem>
#include <map>
#include <nlohmann/json.hpp>
#include <opencv2/imgcodecs.hpp>
#include <opencv2/imgproc.hpp>
#include <utility>
#include <vector>

#include "libs/base/write_file.h"
#include "libs/map_view/image_pixels.h"
#include "libs/map_view/keyframe_pixels.h"
#include "libs/map_view/level_frame.h"
#include "libs/map_view/shutters.h"
#include "libs/mosaic/geotiff.h"
#include "libs/mosaic/mosaic_pictures.h"

namespace mapmend {
namespace {

namespace fs = std::filesystem;
using OrderedJson = nlohmann::ordered_json;

// The keyframes of a component, and how to read their images.
struct Source {
  const FetchImage& fetch;
  std::vector<std::pair<std::string, KeyframeId>> keys;
  std::vector<MosaicImage> images;

  cv::Mat Read(int index, int side) const {
    const std::optional<KeyframeImage> image = fetch(keys[index].first, keys[index].second);
    return image ? DecodePixels(*image, side) : cv::Mat();
  }
  bool HasAny() const {
    return std::any_of(keys.begin(), keys.end(),
                       [&](const auto& key) { return fetch(key.first, key.second).has_value(); });
  }
};

Source ListSource(const Snapshot& snapshot, int component, const FetchImage& fetch) {
  Source source{fetch, {}, {}};
  const std::map<std::string, FoundShutter> shutters = FindShutters(snapshot);
  const std::vector<ReadoutMove> moves = ReadoutMoves(snapshot, component, shutters);
  const std::vector<SnapshotKeyframe>& keyframes = snapshot.components[component].keyframes;
  for (size_t i = 0; i < keyframes.size(); ++i) {
    const std::string& session = snapshot.submaps[keyframes[i].submap].key.session;
    const SessionStarted& started = snapshot.model->GetSession(session).info;
    source.keys.emplace_back(session, keyframes[i].id);
    const auto shutter = shutters.find(session);
    const bool by_columns = shutter != shutters.end() && shutter->second.by_columns;
    source.images.push_back({LensOf(started.camera, started.pinhole),
                             keyframes[i].cam_from_root,
                             {moves[i].shift, moves[i].turn, by_columns}});
  }
  return source;
}

void WritePng(const fs::path& path, const cv::Mat& picture) {
  std::vector<uint8_t> png;
  cv::imencode(".png", picture, png);
  WriteFile(path.string(), std::string(png.begin(), png.end()));
}

// Cells of the coverage that images show, and of these those that fewer than three do.
struct CoverageCells {
  int shown = 0, thin = 0;

  explicit CoverageCells(const cv::Mat& coverage) {
    constexpr int kEnough = 3;
    shown = cv::countNonZero(coverage);
    thin = shown - cv::countNonZero(coverage >= kEnough);
  }
};

// The raster where GDAL is to put it: coordinates of the reference system in full.
GroundRaster InFull(GroundRaster raster, const FrameOfReference& frame) {
  raster.north_west += frame.origin.head<2>();
  return raster;
}

std::string Nothing(const std::string& folder, const std::string& why) {
  std::error_code ignored;
  for (const std::string& file : MosaicFiles()) fs::remove(fs::path(folder) / file, ignored);
  return OrderedJson({{"problem", why}}).dump();
}

// The pictures themselves, and what mosaic.json says of them.
OrderedJson WritePictures(Mosaic* mosaic, const FrameOfReference& frame, const MosaicExportOptions& options,
                          const std::function<void(double)>& progress, const fs::path& folder) {
  const GroundRaster raster = mosaic->Raster(), in_full = InFull(raster, frame);
  MosaicPreview preview(raster, options.preview_px);
  GeoTiffWriter picture((folder / "mosaic.tif").string(), in_full, frame.epsg);
  mosaic->Make(
      [&](const cv::Mat& color, const cv::Mat& mask, const cv::Rect& at) {
        picture.Write(color, mask, at);
        preview.Add(color, mask, at);
      },
      progress);
  picture.Finish(frame.epsg > 0 ? (folder / "mosaic.kmz").string() : "");
  constexpr int kSurfaceStep = 8;
  WriteHeights((folder / "surface.tif").string(), mosaic->Surface(), raster, kSurfaceStep, frame.origin, frame.epsg);
  const bool has_metres = frame.unit == "m";
  cv::Mat small = preview.Picture();
  DrawScaleMarks({preview.Gsd(), has_metres ? "m" : "", frame.epsg > 0 || frame.name == "enu"}, &small);
  WritePng(folder / "mosaic.png", small);
  const int step = std::max(1, std::max(raster.width, raster.height) / (options.preview_px / 2));
  const cv::Mat coverage = mosaic->Coverage(step);
  WritePng(folder / "coverage.png", CoveragePicture(coverage));
  const CoverageCells cells(coverage);
  const double cell_area = step * raster.gsd * step * raster.gsd;
  return {{"gsd", raster.gsd},
          {"unit", frame.unit},
          {"frame", frame.name},
          {"epsg", frame.epsg},
          {"width", raster.width},
          {"height", raster.height},
          {"west", in_full.north_west.x()},
          {"north", in_full.north_west.y()},
          {"images", mosaic->NumImages() - mosaic->NumMissing()},
          {"area", cells.shown * cell_area},
          {"area_of_fewer_than_3_images", cells.thin * cell_area}};
}

}  // namespace

const std::vector<std::string>& MosaicFiles() {
  static const std::vector<std::string> files = {"mosaic.tif",   "surface.tif", "mosaic.png",
                                                 "coverage.png", "mosaic.json", "mosaic.kmz"};
  return files;
}

std::string ExportMosaic(Snapshot snapshot, int component, const FetchImage& image, const MosaicExportOptions& options,
                         const std::function<void(double)>& progress, const std::string& folder) {
  if (!snapshot.components[component].frame.is_z_up) PlaceLevel(component, &snapshot);
  const Source source = ListSource(snapshot, component, image);
  if (!source.HasAny()) return Nothing(folder, "no images of keyframes are stored");
  const FrameOfReference& frame = snapshot.components[component].frame;
  std::vector<Eigen::Vector3d> points;
  for (const ColoredPoint& point : ComponentPoints(snapshot, component)) points.push_back(point.position);
  Mosaic mosaic(options.mosaic, source.images, points, [&](int index, int side) { return source.Read(index, side); });
  if (!mosaic.Problem().empty()) return Nothing(folder, mosaic.Problem());
  if (options.bounds.size() == 4) {
    const Eigen::Vector2d origin = frame.origin.head<2>(), low(options.bounds[0], options.bounds[1]),
                          high(options.bounds[2], options.bounds[3]);
    mosaic.Crop({low - origin, high - origin});
  }
  OrderedJson json = WritePictures(&mosaic, frame, options, progress, folder);
  json["images_missing"] = mosaic.NumMissing();
  WriteFile((fs::path(folder) / "mosaic.json").string(), json.dump(1) + "\n");
  return json.dump();
}

std::string AsJpeg(const std::string& png) {
  const cv::Mat picture = cv::imdecode(std::vector<uint8_t>(png.begin(), png.end()), cv::IMREAD_UNCHANGED);
  if (picture.empty() || picture.channels() != 4) return "";
  cv::Mat color, alpha, on_white(picture.size(), CV_8UC3, cv::Scalar::all(255));
  cv::cvtColor(picture, color, cv::COLOR_BGRA2BGR);
  cv::extractChannel(picture, alpha, 3);
  color.copyTo(on_white, alpha);
  std::vector<uint8_t> jpeg;
  constexpr int kQuality = 85;
  cv::imencode(".jpg", on_white, jpeg, {cv::IMWRITE_JPEG_QUALITY, kQuality});
  return {jpeg.begin(), jpeg.end()};
}

}  // namespace mapmend
