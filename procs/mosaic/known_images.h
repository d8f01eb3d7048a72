#pragma once

#include <chrono>
#include <functional>
#include <map>
#include <optional>
#include <set>
#include <string>
#include <vector>

#include "libs/map_view/image_source.h"
#include "libs/map_view/snapshot.h"
#include "libs/mosaic/tile_file.h"

namespace mapmend {

// The images of keyframes that have been seen: their sizes and brightness, and ids for them. What is known is kept in
// the file of tiles, so that a process that is started again need not read all images once more.
class KnownImages {
 public:
  struct Image {
    TileFile::ImageKey key;
    int width = 0, height = 0;
    cv::Mat brightness;
  };

  // fetch: throws std::runtime_error if the store does not answer. file: must outlive this.
  KnownImages(TileFile* file, FetchImage fetch);

  // Tries to read images of keyframes that are not known yet, the newest first, at most so many. Those that the store
  // does not have are asked for again after Retry. Returns how many were read.
  //   use  gets each of them, decoded, by id; empty: nobody wants more than their brightness
  int Read(const Snapshot& snapshot, int most, const std::function<void(int id, cv::Mat pixels)>& use);
  void Retry() { absent_.clear(); }
  int NumAbsent() const { return static_cast<int>(absent_.size()); }

  // -1: not known.
  int Find(const TileFile::ImageKey& key) const;
  const Image& Get(int id) const { return images_.at(id); }
  // Decoded, with so many pixels along the longer side if there are; throws std::runtime_error if it cannot be had.
  cv::Mat Fetch(int id, int side) const;

 private:
  TileFile* const file_;
  const FetchImage fetch_;
  std::map<TileFile::ImageKey, int> ids_;
  std::map<int, Image> images_;
  std::set<TileFile::ImageKey> absent_;
};

}  // namespace mapmend
