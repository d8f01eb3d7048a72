#pragma once

#include <string>
#include <vector>

#include "libs/geometry/camera.h"

namespace mapmend {

struct ExifCamera {
  bool found = false;
  Camera camera;     // no distortion, principal point in the middle
  std::string note;  // one line: what was taken from where; if not found: why, empty if there is nothing to tell
};

// The camera of photos from what their EXIF says, good to a few percent. Focal length in mm, over the width of the
// sensor: that of a drone or camera whose make and model are known, else from the focal plane's resolution; else the
// 35-mm equivalent, by the diagonal, as CIPA DCG-001 defines it. A few photos from first to last are looked at: all
// that tell a focal length must tell the same one.
ExifCamera GuessCamera(const std::vector<std::string>& files);

}  // namespace mapmend
