#pragma once

#include <array>
#include <map>
#include <string>
#include <utility>
#include <vector>

#include "libs/map_view/snapshot.h"
#include "procs/viewer_export/colmap_camera.h"

namespace mapmend {

// A component as a COLMAP model (Schönberger and Frahm, CVPR 2016; https://colmap.github.io/format.html): the keyframes
// with their features where they are in the images, distorted as the lens has it, and the map points with their tracks.
// COLMAP puts the centre of the first pixel at (0.5, 0.5), mapmend at (0, 0): pixels are shifted by a half.
struct ColmapModel {
  struct Feature {
    double x = 0, y = 0;  // pixels as COLMAP counts them
    int point = -1;       // id of a point; -1: none
  };
  struct Image {
    int id = 0, camera = 0;
    std::string name;
    Rigid3 cam_from_world;
    std::vector<Feature> features;
  };
  struct Observation {
    int image = 0, feature = 0;
  };
  struct Point {
    int id = 0;
    Eigen::Vector3d position;
    std::array<uint8_t, 3> color = {0, 0, 0};
    double error = 0;  // mean of the reprojections, pixels
    std::vector<Observation> track;
  };
  std::vector<ColmapCamera> cameras;  // id: index + 1
  std::vector<Image> images;
  std::vector<Point> points;
};

// The picture that is there for a keyframe.
struct ColmapPicture {
  std::string name;           // of the file, below the folder of images
  int width = 0, height = 0;  // pixels
};

// By session and keyframe.
using ColmapPictures = std::map<std::pair<std::string, KeyframeId>, ColmapPicture>;

// Keyframes without a picture get the name that it would have, and a camera of the size that was tracked. Observations
// that are more than max_error (pixels of the picture) off are left out, as COLMAP does it with its own, and points
// that then have less than two. Points lie where their observations, all taken alike, are met best.
ColmapModel MakeColmapModel(const Snapshot& snapshot, int component, const ColmapPictures& pictures,
                            double max_error = 4);

// cameras.txt, images.txt, points3D.txt; or .bin, little-endian.
struct ColmapFiles {
  std::string cameras, images, points;
};
ColmapFiles ToColmapText(const ColmapModel& model);
ColmapFiles ToColmapBinary(const ColmapModel& model);

// "0/frame_000123.jpg" for session 0.
std::string ColmapPictureName(int session, int frame, const std::string& suffix);

}  // namespace mapmend
