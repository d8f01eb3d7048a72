#pragma once

#include <string>

#include "libs/map_view/image_source.h"
#include "libs/map_view/snapshot.h"

namespace mapmend {

// How many keyframes of the main component have an image in the export.
struct ColmapImages {
  int written = 0, missing = 0;
};

// Writes a component as a COLMAP model into a folder: *.txt, sparse/0/*.bin, and the images below images/. Throws
// std::runtime_error with one line if it cannot.
ColmapImages ExportColmap(const Snapshot& snapshot, int component, const FetchImage& fetch, const std::string& folder);

}  // namespace mapmend
