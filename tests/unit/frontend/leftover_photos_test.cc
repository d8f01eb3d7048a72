#include "procs/frontend/leftover_photos.h"

#include <gtest/gtest.h>

#include "tests/unit/frontend/sparse_flight.h"

namespace mapmend {
namespace leftover_photos_test {

std::vector<int> IndicesOf(const std::vector<FramePtr>& frames) {
  std::vector<int> indices;
  for (const FramePtr& f : frames) indices.push_back(f->index);
  return indices;
}

TEST(LeftoverPhotos, ThoseOfTheSameGroundAreFoundMostAlikeFirst) {
  SparseFlight flight(1);
  LeftoverPhotos leftovers({.max_alike = 2});
  leftovers.Add(flight.Photo(flight.Pose(5, 5), 0));
  for (int i = 1; i <= 3; ++i) leftovers.Add(flight.Photo(flight.Pose(0.3 * i, 0), i));
  const FramePtr frame = flight.Photo(flight.Pose(0.92, 0), 4);
  EXPECT_EQ(IndicesOf(leftovers.Alike(*frame)), (std::vector<int>{3, 2}));
}

TEST(LeftoverPhotos, WhatHasAPoseIsRemovedAndTheOldestAreForgotten) {
  SparseFlight flight(2);
  LeftoverPhotos leftovers({.max_kept = 2, .max_alike = 10});
  std::vector<FramePtr> photos;
  for (int i = 0; i < 3; ++i) {
    photos.push_back(flight.Photo(flight.Pose(0.3 * i, 0), i));
    leftovers.Add(photos.back());
    leftovers.Add(photos.back());  // it is there once
  }
  const FramePtr frame = flight.Photo(flight.Pose(0.65, 0), 3);
  EXPECT_EQ(IndicesOf(leftovers.Alike(*frame)), (std::vector<int>{2, 1}));
  leftovers.Remove(photos[2]);
  EXPECT_EQ(IndicesOf(leftovers.Alike(*frame)), (std::vector<int>{1}));
}

}  // namespace leftover_photos_test
}  // namespace mapmend
