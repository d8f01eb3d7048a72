#include <GeographicLib/LocalCartesian.hpp>
#include <cmath>
#include <cstdio>
#include <filesystem>
#include <future>
#include <nlohmann/json.hpp>
#include <stdexcept>

#include "libs/base/text_format.h"
#include "libs/base/write_file.h"
#include "tools/simulate/frame_writer.h"
#include "tools/simulate/parallel.h"
#include "tools/simulate/random.h"
#include "tools/simulate/simulator.h"

namespace mapmend::simulate {
namespace {

std::string Text(const char* format, auto... values) {
  char line[512];
  std::snprintf(line, sizeof line, format, values...);
  return line;
}

template <typename T>
void Append(std::string* bytes, T value) {
  bytes->append(reinterpret_cast<const char*>(&value), sizeof value);
}

}  // namespace

std::string FormatCamera(const Scenario& scenario) {
  const Camera& c = scenario.camera;
  const bool fisheye = c.model == Camera::Model::kFisheye;
  std::string text = "%YAML:1.0\n# exact: made by mapmend simulate, scenario " + scenario.name + "\n";
  text += Text("Camera.type: \"%s\"\n", fisheye ? "KannalaBrandt8" : "PinHole");
  text += Text("Camera.fx: %.10g\nCamera.fy: %.10g\nCamera.cx: %.10g\nCamera.cy: %.10g\n", c.fx, c.fy, c.cx, c.cy);
  const char* names[] = {"k1", "k2", fisheye ? "k3" : "p1", fisheye ? "k4" : "p2", "k3"};
  for (int i = 0; i < (fisheye ? 4 : 5); ++i) text += Text("Camera.%s: %.10g\n", names[i], c.distortion[i]);
  text += Text("Camera.width: %d\nCamera.height: %d\nCamera.fps: %.10g\n", c.width, c.height, scenario.fps);
  return text;
}

std::string FormatGps(const Simulator& simulator, int first, int last) {
  const Scenario& s = simulator.GetScenario();
  const GeographicLib::LocalCartesian local(s.output.gps_origin_lat, s.output.gps_origin_lon, s.output.gps_origin_alt);
  std::string text = "time_s,latitude_deg,longitude_deg,altitude_m,sigma_horizontal_m,sigma_vertical_m\n";
  const double sigma = s.output.gps_noise, begin = simulator.Time(first), end = simulator.Time(last);
  const uint64_t seed = Hash(s.seed, 71);
  for (auto second = static_cast<int64_t>(std::ceil(begin)); static_cast<double>(second) <= end; ++second) {
    const auto t = static_cast<double>(second);
    Eigen::Vector3d p = simulator.Motion().WorldFromCamera(t).translation;
    for (uint64_t axis = 0; axis < 3; ++axis) {
      // Mostly an offset that wanders over minutes, as satellite errors do, and a third white noise.
      Random white(Hash(seed + axis, static_cast<uint64_t>(second)));
      p[static_cast<int>(axis)] +=
          sigma * (axis == 2 ? 1.6 : 1.0) * (1.8 * ValueNoise(t / 60, 0.5, seed + axis) + 0.33 * white.Gaussian());
    }
    double latitude = 0, longitude = 0, altitude = 0;
    local.Reverse(p.x(), p.y(), p.z(), latitude, longitude, altitude);
    text +=
        Text("%.6f,%.9f,%.9f,%.3f,%.2f,%.2f\n", s.start_time + t, latitude, longitude, altitude, sigma, 1.6 * sigma);
  }
  return text;
}

std::string FormatEvents(const Simulator& simulator, int first, int last) {
  const Scenario& s = simulator.GetScenario();
  nlohmann::ordered_json json;
  json["scenario"] = s.name;
  json["description"] = s.description;
  json["seed"] = s.seed;
  json["fps"] = s.fps;
  json["first_frame"] = first;
  json["last_frame"] = last;
  json["events"] = nlohmann::ordered_json::array();
  for (const Event& event : s.events) {
    // Indices of the frames as written: frames left out do not count.
    int begin = -1, end = -1, written = 0;
    for (int i = first; i <= last; ++i) {
      const double t = simulator.Time(i);
      const bool inside = t >= event.at && t < event.at + event.duration;
      if (event.kind == Event::Kind::kSkip) {
        if (inside && begin < 0) begin = written;  // the first frame after the hole
        if (inside) end = written;
      } else if (inside && !simulator.LeftOut(i)) {
        if (begin < 0) begin = written;
        end = written;
      }
      written += simulator.LeftOut(i) ? 0 : 1;
    }
    if (begin < 0) continue;
    nlohmann::ordered_json entry;
    entry["kind"] = EventName(event.kind);
    entry["time_s"] = s.start_time + event.at;
    entry["duration_s"] = event.duration;
    entry["amount"] = event.amount;
    entry["first_written_frame"] = begin;
    entry["last_written_frame"] = end;
    json["events"].push_back(entry);
  }
  return json.dump(2) + "\n";
}

std::string FormatTerrain(const Simulator& simulator) {
  const Scene& scene = simulator.GetScene();
  const HeightGrid& grid = scene.grid;
  const double width = (grid.width - 1) * grid.spacing, length = (grid.height - 1) * grid.spacing;
  const double step = std::max(grid.spacing, std::sqrt(width * length / 150000));
  const int nx = static_cast<int>(width / step), ny = static_cast<int>(length / step);
  std::string text = Text(
      "ply\nformat binary_little_endian 1.0\ncomment surface from above, metres, east north up\nelement vertex %d\n"
      "property float x\nproperty float y\nproperty float z\nproperty uchar red\nproperty uchar green\nproperty uchar "
      "blue\n"
      "element face %d\nproperty list uchar int vertex_indices\nend_header\n",
      nx * ny, 2 * (nx - 1) * (ny - 1));
  std::vector<std::string> rows(ny);
  ParallelFor(ny, 4, simulator.NumThreads(), [&](int begin, int end) {
    for (int j = begin; j < end; ++j) {
      for (int i = 0; i < nx; ++i) {
        const Eigen::Vector3d origin(grid.x0 + (i + 0.5) * step, grid.y0 + (j + 0.5) * step, scene.survey_height);
        const Eigen::Vector3d down(0, 0, -1);
        const Hit hit = scene.Cast(origin, down);
        const Color color = scene.Shade(origin, down, hit, step / std::max(1.0, hit.distance));
        const uint32_t rgb = Pack(color);
        Append(&rows[j], static_cast<float>(origin.x()));
        Append(&rows[j], static_cast<float>(origin.y()));
        Append(&rows[j], static_cast<float>(origin.z() - (std::isfinite(hit.distance) ? hit.distance : origin.z())));
        for (int c = 0; c < 3; ++c) Append(&rows[j], static_cast<uint8_t>(rgb >> (8 * c)));
      }
    }
  });
  for (const std::string& row : rows) text += row;
  for (int j = 0; j + 1 < ny; ++j) {
    for (int i = 0; i + 1 < nx; ++i) {
      const int32_t a = j * nx + i;
      for (const auto& t : {std::array{a, a + 1, a + nx}, std::array{a + 1, a + nx + 1, a + nx}}) {
        Append(&text, uint8_t{3});
        for (const int32_t v : t) Append(&text, v);
      }
    }
  }
  return text;
}

bool WriteRun(Simulator* simulator, int first, int last, const std::string& dir,
              const std::function<bool(int, int)>& progress) {
  const Scenario& s = simulator->GetScenario();
  std::error_code error;
  std::filesystem::create_directories(dir, error);
  if (!std::filesystem::is_directory(dir))
    throw std::runtime_error(dir + ": cannot be made a folder: " + error.message());
  auto writer = s.output.images ? FrameWriter::Images(dir)
                                : FrameWriter::Video(dir, s.camera.width, s.camera.height, s.fps, s.output.crf);
  std::vector<int> indices;
  for (int i = first; i <= last; ++i) {
    if (!simulator->LeftOut(i)) indices.push_back(i);
  }
  if (indices.empty()) throw std::runtime_error("scenario " + s.name + ": the events leave out every frame asked for");
  Trajectory truth;
  std::string times;
  Frame frames[2];
  std::future<void> writing;  // one frame is encoded while the next is rendered
  for (size_t k = 0; k < indices.size(); ++k) {
    const int i = indices[k];
    simulator->Render(i, &frames[k % 2]);
    if (writing.valid()) writing.get();
    writing = std::async(std::launch::async, [&writer, frame = &frames[k % 2]] { writer->Write(*frame); });
    truth.push_back({simulator->Utime(i), simulator->WorldFromCamera(i)});
    times += FormatSeconds(simulator->Utime(i)) + "\n";
    if (!progress(static_cast<int>(k) + 1, static_cast<int>(indices.size()))) {
      writing.wait();
      return false;
    }
  }
  writing.get();
  WriteFile(dir + "/times.txt", times);
  WriteFile(dir + "/camera.yaml", FormatCamera(s));
  WriteTrajectory(dir + "/groundtruth.tum", truth,
                  Format("t tx ty tz qx qy qz qw, world_from_camera, metres, east north up; exact (mapmend simulate); "
                         "origin: %.9f %.9f %.3f",
                         s.output.gps_origin_lat, s.output.gps_origin_lon, s.output.gps_origin_alt));
  WriteFile(dir + "/gps.csv", FormatGps(*simulator, first, last));
  WriteFile(dir + "/events.json", FormatEvents(*simulator, first, last));
  WriteFile(dir + "/terrain.ply", FormatTerrain(*simulator));
  writer->Finish();
  return true;
}

}  // namespace mapmend::simulate
