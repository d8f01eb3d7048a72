#include "procs/submap_store/wanted_images.h"

#include <gtest/gtest.h>

#include "libs/base/checksum.h"

namespace mapmend {
namespace wanted_images_test {

using std::chrono::milliseconds;

const WantedImages::Clock::time_point kStart = WantedImages::Clock::time_point(std::chrono::hours(1));

ImagePiece Piece(int keyframe, const std::vector<uint8_t>& whole, size_t from, size_t to) {
  ImagePiece piece;
  piece.image.session = std::string("s");
  piece.image.keyframe = KeyframeId(keyframe);
  piece.image.frame = 10 * keyframe;
  piece.image.width = piece.image.height = 8;
  piece.image.encoding = std::string("jpeg");
  piece.image.bytes.assign(whole.begin() + static_cast<long>(from), whole.begin() + static_cast<long>(to));
  piece.size = static_cast<int>(whole.size());
  piece.crc32 = Crc32(whole.data(), whole.size());
  piece.offset = static_cast<int>(from);
  return piece;
}

WantedImages Wanting(int count) {
  WantedImages wanted;
  for (int i = 0; i < count; ++i) wanted.Add(KeyframeId(i), 10 * i, false);
  return wanted;
}

std::vector<int> Keyframes(const std::optional<ImageRequest>& request) {
  std::vector<int> ids;
  if (!request) return ids;
  for (const WantedImage& wanted : request->wanted) ids.push_back(wanted.keyframe.value);
  return ids;
}

TEST(WantedImages, AsksForTheNewestAFewAtATimeAndWaits) {
  WantedImages wanted = Wanting(10);
  wanted.Add(KeyframeId(20), 200, true);
  const auto request = wanted.NextRequest("s", kStart);
  EXPECT_EQ(Keyframes(request), (std::vector<int>{9, 8, 7, 6}));
  EXPECT_EQ(request->wanted[0].frame, 90);
  EXPECT_FALSE(wanted.NextRequest("s", kStart + milliseconds(900)));
  // Nobody answers: again after one, two, four seconds, not more often.
  int num_requests = 0;
  for (int ms = 0; ms <= 7500; ms += 50) num_requests += wanted.NextRequest("s", kStart + milliseconds(ms)).has_value();
  EXPECT_EQ(num_requests, 3);
}

TEST(WantedImages, PutsPiecesTogetherAndGoesOnWithTheNextOnes) {
  WantedImages wanted = Wanting(6);
  wanted.NextRequest("s", kStart);
  const std::vector<uint8_t> whole = {1, 2, 3, 4, 5, 6, 7};
  EXPECT_FALSE(wanted.Take(Piece(5, whole, 0, 3), kStart));
  EXPECT_FALSE(wanted.Take(Piece(5, whole, 5, 7), kStart)) << "a piece is missing in between";
  // What has come need not come again.
  const auto again = wanted.NextRequest("s", kStart + milliseconds(1100));
  ASSERT_EQ(Keyframes(again), (std::vector<int>{5, 4, 3, 2}));
  EXPECT_EQ(again->wanted[0].offset, 3);
  EXPECT_EQ(again->wanted[1].offset, 0);
  const auto image = wanted.Take(Piece(5, whole, 3, 7), kStart);
  ASSERT_TRUE(image);
  EXPECT_EQ(image->bytes, whole);
  EXPECT_EQ(wanted.NumStored(), 0) << "not before it is in the file";
  wanted.Stored(KeyframeId(5), kStart);
  EXPECT_EQ(wanted.NumStored(), 1);
  const auto next = wanted.NextRequest("s", kStart + milliseconds(1200));
  EXPECT_EQ(Keyframes(next), (std::vector<int>{1}));
  EXPECT_EQ(next->stored, (std::vector<KeyframeId>{KeyframeId(5)}));
}

TEST(WantedImages, BelievesNothingThatWasNotAskedForOrDoesNotFit) {
  WantedImages wanted = Wanting(6);
  const std::vector<uint8_t> whole = {1, 2, 3};
  EXPECT_FALSE(wanted.Take(Piece(5, whole, 0, 3), kStart)) << "not asked for yet";
  wanted.NextRequest("s", kStart);
  EXPECT_FALSE(wanted.Take(Piece(1, whole, 0, 3), kStart)) << "not asked for yet";
  ImagePiece other_frame = Piece(5, whole, 0, 3);
  other_frame.image.frame = 51;
  EXPECT_FALSE(wanted.Take(other_frame, kStart));
  ImagePiece damaged = Piece(5, whole, 0, 3);
  damaged.image.bytes[1] ^= 1;
  EXPECT_FALSE(wanted.Take(damaged, kStart));
  EXPECT_TRUE(wanted.Take(Piece(5, whole, 0, 3), kStart));
}

TEST(WantedImages, WhatItsSenderDoesNotHaveIsNotAskedForAgain) {
  WantedImages wanted = Wanting(2);
  wanted.NextRequest("s", kStart);
  ImagePiece none;
  none.image.session = std::string("s");
  none.image.keyframe = KeyframeId(1);
  none.image.frame = 10;
  wanted.Take(none, kStart);
  EXPECT_EQ(wanted.NumLost(), 1);
  EXPECT_EQ(Keyframes(wanted.NextRequest("s", kStart + milliseconds(5000))), (std::vector<int>{0}));
  wanted.Remove(KeyframeId(0));
  EXPECT_TRUE(wanted.Awaited().empty());
  EXPECT_EQ(Keyframes(wanted.NextRequest("s", kStart + milliseconds(20000))), (std::vector<int>{}));
}

}  // namespace wanted_images_test
}  // namespace mapmend
