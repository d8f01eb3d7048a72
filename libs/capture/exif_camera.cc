#include "libs/capture/exif_camera.h"

#include <algorithm>
#include <array>
#include <cctype>
#include <cmath>
#include <exiv2/exiv2.hpp>
#include <filesystem>
#include <optional>
#include <string_view>

#include "libs/base/text_format.h"

namespace mapmend {
namespace {

constexpr size_t kLookedAt = 12;
constexpr double kFullFrameDiagonal = 43.267;                  // mm
constexpr double kMinSensor = 2, kMaxSensor = 60;              // mm, wide side
constexpr double kMinFocalLength = 0.3, kMaxFocalLength = 10;  // of the image's long side
constexpr double kSameFocalLength = 0.005;                     // relative

// Sensors of cameras that fly, wide side in mm, as their makers tell them.
struct KnownSensor {
  std::string_view model;
  double width;
};
constexpr std::array kKnownSensors = std::to_array<KnownSensor>({
    {"FC200", 6.17},   {"FC300C", 6.17},   {"FC300S", 6.17},     {"FC300X", 6.17},    {"FC300SE", 6.17},
    {"FC330", 6.17},   {"FC350", 6.17},    {"FC220", 6.17},      {"FC1102", 6.17},    {"FC2103", 6.17},
    {"FC2204", 6.17},  {"FC7203", 6.17},   {"FC7303", 6.17},     {"FC3170", 6.4},     {"FC3411", 13.2},
    {"FC3582", 9.7},   {"FC8482", 9.7},    {"FC6310", 13.2},     {"FC6310S", 13.2},   {"FC6310R", 13.2},
    {"FC550", 17.3},   {"FC550RAW", 17.3}, {"FC6510", 13.2},     {"FC6520", 17.3},    {"FC6540", 23.5},
    {"L1D-20c", 13.2}, {"L2D-20c", 17.3},  {"M3E", 17.3},        {"ZenmuseP1", 35.9}, {"ANAFI", 5.95},
    {"XT701", 6.4},    {"XT705", 13.2},    {"DSC-RX1RM2", 35.9}, {"ILCE-QX1", 23.2},  {"ILCE-6000", 23.5},
});

struct Told {
  std::string make, model;
  double focal_length = 0, focal_length_35 = 0;  // mm, 0: not told
  double resolution = 0;                         // focal plane, pixels per mm of a photo of full_width, 0: not told
  int full_width = 0, width = 0, height = 0;     // pixels
};

class Tags {
 public:
  explicit Tags(const Exiv2::ExifData& data) : data_(data) {}

  std::string Text(const char* key) const {
    const auto found = data_.findKey(Exiv2::ExifKey(key));
    if (found == data_.end()) return {};
    std::string text = found->toString();
    text.erase(std::find(text.begin(), text.end(), '\0'), text.end());
    std::replace_if(
        text.begin(), text.end(), [](unsigned char c) { return std::iscntrl(c) != 0; }, ' ');
    const size_t last = text.find_last_not_of(' ');
    return text.substr(0, last == std::string::npos ? 0 : last + 1);
  }
  // 0 if it is not there, or makes no sense.
  double Number(const char* key) const {
    const auto found = data_.findKey(Exiv2::ExifKey(key));
    if (found == data_.end() || found->count() == 0) return 0;
    const Exiv2::Rational fraction = found->toRational();
    if (fraction.second == 0) return 0;
    const double value = static_cast<double>(fraction.first) / fraction.second;
    return std::isfinite(value) && value > 0 ? value : 0;
  }

 private:
  const Exiv2::ExifData& data_;
};

double MillimetresOf(int unit) {
  switch (unit) {
    case 3:
      return 10;
    case 4:
      return 1;
    case 5:
      return 0.001;
    default:
      return 25.4;  // EXIF's default
  }
}

// nullopt without EXIF.
std::optional<Told> ReadTold(const std::string& file) {
  try {
    const auto image = Exiv2::ImageFactory::open(file);
    image->readMetadata();
    if (image->exifData().empty()) return std::nullopt;
    const Tags tags(image->exifData());
    Told told;
    told.make = tags.Text("Exif.Image.Make");
    told.model = tags.Text("Exif.Image.Model");
    told.focal_length = tags.Number("Exif.Photo.FocalLength");
    told.focal_length_35 = tags.Number("Exif.Photo.FocalLengthIn35mmFilm");
    const double unit = MillimetresOf(static_cast<int>(tags.Number("Exif.Photo.FocalPlaneResolutionUnit")));
    told.resolution = tags.Number("Exif.Photo.FocalPlaneXResolution") / unit;
    told.width = static_cast<int>(image->pixelWidth());
    told.height = static_cast<int>(image->pixelHeight());
    const double full = std::max(tags.Number("Exif.Photo.PixelXDimension"), tags.Number("Exif.Photo.PixelYDimension"));
    told.full_width = full > 0 ? static_cast<int>(full) : std::max(told.width, told.height);
    return told;
  } catch (const std::exception&) {  // unreadable, or of a format without EXIF
    return std::nullopt;
  }
}

struct FocalLength {
  double pixels = 0;
  std::string source;
};

// pixels is 0 if nothing tells.
FocalLength FindFocalLength(const Told& told) {
  const double long_side = std::max(told.width, told.height);
  const auto by_sensor = [&](double sensor, const std::string& source) {
    return FocalLength{told.focal_length / sensor * long_side,
                       Format("%.4g mm over a sensor of %.4g mm (%s)", told.focal_length, sensor, source.c_str())};
  };
  if (told.focal_length > 0) {
    const auto known = std::find_if(kKnownSensors.begin(), kKnownSensors.end(),
                                    [&](const KnownSensor& sensor) { return sensor.model == told.model; });
    if (known != kKnownSensors.end()) return by_sensor(known->width, "known of " + told.model);
    const double sensor = told.resolution > 0 ? told.full_width / told.resolution : 0;
    if (sensor >= kMinSensor && sensor <= kMaxSensor) return by_sensor(sensor, "focal plane resolution");
  }
  if (told.focal_length_35 > 0) {
    return {told.focal_length_35 / kFullFrameDiagonal * std::hypot(told.width, told.height),
            Format("%.4g mm, as of 35-mm film", told.focal_length_35)};
  }
  return {};
}

Camera MakeCamera(const Told& told, double focal_length) {
  Camera camera;
  camera.width = told.width;
  camera.height = told.height;
  camera.fx = camera.fy = focal_length;
  camera.cx = (told.width - 1) / 2.0;
  camera.cy = (told.height - 1) / 2.0;
  return camera;
}

std::string FileName(const std::string& file) { return std::filesystem::path(file).filename().string(); }

}  // namespace

ExifCamera GuessCamera(const std::vector<std::string>& files) {
  Exiv2::LogMsg::setLevel(Exiv2::LogMsg::mute);
  ExifCamera guess;
  std::string first_file;
  FocalLength first;
  const size_t step = std::max<size_t>(1, files.size() / kLookedAt);
  for (size_t i = 0; i < files.size(); i += step) {
    const std::optional<Told> told = ReadTold(files[i]);
    if (!told) continue;
    const FocalLength found = FindFocalLength(*told);
    const double share = found.pixels / std::max({told->width, told->height, 1});
    if (share < kMinFocalLength || share > kMaxFocalLength) {
      if (guess.note.empty() && !guess.found) {
        guess.note =
            "the EXIF of " + FileName(files[i]) +
            (found.pixels > 0 ? " tells no focal length that can be" : " does not tell a focal length with a sensor");
      }
      continue;
    }
    if (!guess.found) {
      guess.found = true;
      guess.camera = MakeCamera(*told, found.pixels);
      first = found;
      first_file = files[i];
      const std::string who = told->make.empty() && told->model.empty() ? "" : told->make + " " + told->model + ", ";
      guess.note = Format("camera guessed from EXIF: %sfocal length %.0f px of %d x %d: ", who.c_str(), found.pixels,
                          told->width, told->height) +
                   found.source + "; a calibration is better (`mapmend calibrate` makes one of the finished map)";
    } else if (std::abs(found.pixels - first.pixels) > kSameFocalLength * first.pixels) {
      guess.found = false;
      guess.note = Format("the photos' EXIF tells different focal lengths (%.0f px in ", first.pixels) +
                   FileName(first_file) + Format(", %.0f px in ", found.pixels) + FileName(files[i]) + ")";
      return guess;
    }
  }
  return guess;
}

}  // namespace mapmend
