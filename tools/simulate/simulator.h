#pragma once

#include <functional>
#include <memory>
#include <string>

#include "libs/geometry/trajectory_file.h"
#include "tools/simulate/material.h"
#include "tools/simulate/renderer.h"
#include "tools/simulate/scenario.h"
#include "tools/simulate/trajectory.h"

namespace mapmend::simulate {

// A scenario made real: its scene, its camera, and any of its frames.
class Simulator {
 public:
  // data_folder: with simulator/ in it. Throws std::runtime_error naming what is missing.
  Simulator(const Scenario& scenario, const std::string& data_folder, int num_threads);

  // Frame index of the scenario, 0 .. frames - 1: a function of the scenario, its seed and the index alone.
  void Render(int index, Frame* frame);
  // The time of a frame since the start, seconds; and whether an event leaves it out.
  double Time(int index) const { return index / scenario_.fps; }
  int64_t Utime(int index) const;
  bool LeftOut(int index) const;
  Rigid3 WorldFromCamera(int index) const { return motion_.WorldFromCamera(Time(index)); }
  SensorState Sensor(int index) const;

  const Scenario& GetScenario() const { return scenario_; }
  int NumThreads() const { return num_threads_; }
  const Scene& GetScene() const { return *scene_; }
  const Renderer& GetRenderer() const { return *renderer_; }
  const CameraMotion& Motion() const { return motion_; }

 private:
  Scenario scenario_;
  int num_threads_;
  CameraMotion motion_;
  std::unique_ptr<Scene> scene_;
  std::unique_ptr<Renderer> renderer_;
};

// Renders frames first to last (both included) into DIR: video.mp4 or images/, times.txt, camera.yaml, groundtruth.tum,
// gps.csv, events.json, terrain.ply. Everything is written once all frames are there; the video gets its name last.
//   progress  called after each frame with the number done and the number of all; returns false to stop
// Returns false if stopped (nothing is left then). Throws std::runtime_error with one line.
bool WriteRun(Simulator* simulator, int first, int last, const std::string& dir,
              const std::function<bool(int, int)>& progress);

// Writes DIR/ortho.png, the land exactly as it is seen from straight above without any sensor, and DIR/ortho.pgw, its
// world file: metres, x east, y north.
//   gsd  size of a pixel on the ground, metres
void WriteOrtho(const Simulator& simulator, double gsd, const std::string& dir);

// The files' texts, for the frames that are not left out.
std::string FormatCamera(const Scenario& scenario);
std::string FormatGps(const Simulator& simulator, int first, int last);
std::string FormatEvents(const Simulator& simulator, int first, int last);
// A mesh of the surface seen from above (from below the ceiling indoors), with colour; binary.
std::string FormatTerrain(const Simulator& simulator);

}  // namespace mapmend::simulate
