#pragma once

#include <map>
#include <string>
#include <utility>

#include "libs/map_view/image_source.h"
#include "libs/map_view/snapshot.h"

namespace mapmend {

// "0-2.jpg": of the connection of submaps 0 and 2, as the report numbers them.
std::string EdgePictureName(int a, int b);

// Writes a small picture of each connection of the tree into a folder (the strongest, if they are very many), and
// removes those of an earlier export. Throws std::runtime_error with one line if it cannot.
void ExportEdgePictures(const Snapshot& snapshot, const PictureSource& source, const std::string& folder);

// Those that are there, by the numbers of their submaps, as bytes of JPEG.
std::map<std::pair<int, int>, std::string> ReadEdgePictures(const std::string& folder);

}  // namespace mapmend
