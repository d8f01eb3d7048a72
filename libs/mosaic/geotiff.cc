#include "libs/mosaic/geotiff.h"

#include <cpl_conv.h>
#include <gdal_priv.h>
#include <gdal_utils.h>
#include <ogr_spatialref.h>

#include <array>
#include <cstdio>
#include <stdexcept>
#include <vector>

namespace mapmend {
namespace {

[[noreturn]] void Fail(const std::string& path) {
  const std::string why = CPLGetLastErrorMsg();
  throw std::runtime_error(path + ": cannot be written" + (why.empty() ? "" : ": " + why));
}

struct CloseDataset {
  void operator()(GDALDataset* dataset) const { GDALClose(dataset); }
};
using Dataset = std::unique_ptr<GDALDataset, CloseDataset>;

std::string ReferenceText(int epsg) {
  OGRSpatialReference reference;
  if (epsg > 0) {
    reference.importFromEPSG(epsg);
  } else {
    reference.SetLocalCS("map");
  }
  char* text = nullptr;
  reference.exportToWkt(&text);
  std::string wkt = text != nullptr ? text : "";
  CPLFree(text);
  return wkt;
}

// Where it lies until it is optimized.
std::string RawPath(const std::string& path) { return path + ".raw"; }

Dataset CreateRaw(const std::string& path, const GroundRaster& raster, int bands, GDALDataType type, int epsg) {
  GDALAllRegister();
  constexpr GIntBig kCacheBytes = GIntBig{48} << 20;  // GDAL takes a twentieth of the machine's memory unless told
  GDALSetCacheMax64(kCacheBytes);
  CPLSetErrorHandler(CPLQuietErrorHandler);
  GDALDriver* driver = GetGDALDriverManager()->GetDriverByName("GTiff");
  if (driver == nullptr) throw std::runtime_error(path + ": GDAL has no driver for GeoTIFF");
  char** options = nullptr;
  for (const char* option : {"TILED=YES", "SPARSE_OK=TRUE", "COMPRESS=DEFLATE", "ZLEVEL=1", "BIGTIFF=IF_SAFER"})
    options = CSLAddString(options, option);
  if (bands == 4) options = CSLAddString(CSLAddString(options, "PHOTOMETRIC=RGB"), "ALPHA=YES");
  Dataset dataset(driver->Create(RawPath(path).c_str(), raster.width, raster.height, bands, type, options));
  CSLDestroy(options);
  if (!dataset) Fail(path);
  std::array<double, 6> transform = {raster.north_west.x(), raster.gsd, 0, raster.north_west.y(), 0, -raster.gsd};
  dataset->SetGeoTransform(transform.data());
  dataset->SetProjection(ReferenceText(epsg).c_str());
  return dataset;
}

// What was created, in a format: options of gdal_translate.
void Translate(const std::string& from, const std::string& path, const std::vector<const char*>& words) {
  char** arguments = nullptr;
  for (const char* word : words) arguments = CSLAddString(arguments, word);
  GDALTranslateOptions* options = GDALTranslateOptionsNew(arguments, nullptr);
  CSLDestroy(arguments);
  Dataset source(static_cast<GDALDataset*>(GDALOpen(from.c_str(), GA_ReadOnly)));
  // The name tells some drivers what to write.
  const std::string part = path.substr(0, path.rfind('.')) + ".part" + path.substr(path.rfind('.'));
  bool good = source != nullptr && options != nullptr;
  if (good) {
    Dataset made(static_cast<GDALDataset*>(GDALTranslate(part.c_str(), source.get(), options, nullptr)));
    good = made != nullptr;
  }
  GDALTranslateOptionsFree(options);
  if (good && std::rename(part.c_str(), path.c_str()) == 0) return;
  std::remove(part.c_str());
  Fail(path);
}

// What was created becomes a cloud optimized GeoTIFF.
void Optimize(const std::string& path, std::vector<const char*> words) {
  for (const char* word : {"-of", "COG", "-co", "BIGTIFF=IF_SAFER"}) words.push_back(word);
  Translate(RawPath(path), path, words);
}

// It goes, whatever happens.
struct RawFile {
  std::string path;
  ~RawFile() { std::remove(path.c_str()); }
};

}  // namespace

struct GeoTiffWriter::Impl {
  std::string path;
  Dataset dataset;
};

GeoTiffWriter::GeoTiffWriter(const std::string& path, const GroundRaster& raster, int epsg)
    : impl_(std::make_unique<Impl>()) {
  impl_->path = path;
  impl_->dataset = CreateRaw(path, raster, 4, GDT_Byte, epsg);
}

GeoTiffWriter::~GeoTiffWriter() {
  if (!impl_->dataset) return;
  impl_->dataset.reset();
  std::remove(RawPath(impl_->path).c_str());
}

void GeoTiffWriter::Write(const cv::Mat& color, const cv::Mat& mask, const cv::Rect& at) {
  std::vector<cv::Mat> bands;
  cv::split(color, bands);
  const std::array<cv::Mat, 4> rgba = {bands[2], bands[1], bands[0], mask.clone()};
  for (int b = 0; b < 4; ++b) {
    const cv::Mat& band = rgba[static_cast<size_t>(b)];
    const CPLErr error = impl_->dataset->GetRasterBand(b + 1)->RasterIO(GF_Write, at.x, at.y, at.width, at.height,
                                                                        band.data, at.width, at.height, GDT_Byte, 0,
                                                                        static_cast<GSpacing>(band.step[0]), nullptr);
    if (error != CE_None) Fail(impl_->path);
  }
}

void GeoTiffWriter::Finish(const std::string& overlay) {
  impl_->dataset.reset();
  const RawFile raw{RawPath(impl_->path)};
  if (!overlay.empty())
    Translate(raw.path, overlay, {"-of", "KMLSUPEROVERLAY", "-co", "FORMAT=AUTO", "-co", "NAME=mosaic"});
  Optimize(impl_->path, {"-b", "1", "-b", "2", "-b", "3", "-mask", "4", "-co", "COMPRESS=JPEG", "-co", "QUALITY=90"});
}

void WriteHeights(const std::string& path, const GroundSurface& surface, const GroundRaster& raster, int step,
                  const Eigen::Vector3d& offset, int epsg) {
  GroundRaster coarse = raster;
  coarse.gsd = raster.gsd * step;
  coarse.width = (raster.width + step - 1) / step;
  coarse.height = (raster.height + step - 1) / step;
  GroundRaster in_full = coarse;
  in_full.north_west += offset.head<2>();
  const RawFile raw{RawPath(path)};
  Dataset dataset = CreateRaw(path, in_full, 1, GDT_Float32, epsg);
  std::vector<float> line(static_cast<size_t>(coarse.width));
  for (int row = 0; row < coarse.height; ++row) {
    for (int column = 0; column < coarse.width; ++column) {
      const Eigen::Vector2d place = coarse.Place(column, row);
      line[static_cast<size_t>(column)] = static_cast<float>(surface.Height(place.x(), place.y()) + offset.z());
    }
    if (dataset->GetRasterBand(1)->RasterIO(GF_Write, 0, row, coarse.width, 1, line.data(), coarse.width, 1,
                                            GDT_Float32, 0, 0, nullptr) != CE_None) {
      Fail(path);
    }
  }
  dataset.reset();
  Optimize(path, {"-co", "COMPRESS=DEFLATE"});
}

}  // namespace mapmend
