#include "libs/wire/image_codec.h"

#include <gtest/gtest.h>

#include <functional>

#include "tests/unit/wire/random_values.h"

namespace mapmend {
namespace image_codec_test {

KeyframeImage RandomImage(RandomValues* random) {
  KeyframeImage image;
  image.session = random->Session();
  image.keyframe = KeyframeId(random->Int(-1, 1 << 30));
  image.frame = random->Int(0, 1 << 30);
  image.utime = random->Seq();
  image.width = random->Int(1, 9000);
  image.height = random->Int(1, 9000);
  image.encoding = random->Bool() ? "jpeg" : "png";
  image.bytes = random->Bytes();
  image.bytes.push_back(1);
  return image;
}

TEST(ImageCodec, WhatIsEncodedComesBack) {
  RandomValues random(3);
  for (int i = 0; i < 200; ++i) {
    ImagePiece piece{RandomImage(&random), 0, static_cast<uint32_t>(random.Seq()), random.Int(0, 1000000)};
    piece.size = piece.offset + static_cast<int>(piece.image.bytes.size()) + random.Int(0, 5000);
    ExpectBack(piece);
    ImagePiece none;
    none.image.session = random.Session();
    none.image.keyframe = KeyframeId(random.Int(0, 1000));
    ExpectBack(none);
    ImageRequest request;
    request.session = random.Session();
    request.wanted = random.List<WantedImage>(5, [&] {
      return WantedImage{KeyframeId(random.Int(0, 1000)), random.Int(0, 1000), random.Int(0, 1 << 30)};
    });
    request.stored = random.List<KeyframeId>(70, [&] { return KeyframeId(random.Int(0, 1000)); });
    ExpectBack(request);
    ExpectBack(ImageFetch{{random.Seq(), random.Text()}, random.Session(), KeyframeId(random.Int(-1, 1000))});
    ImageAnswer answer;
    answer.id = random.Seq();
    ExpectBack(answer);
    answer.status = ImageAnswer::Status::kOk;
    answer.image = RandomImage(&random);
    ExpectBack(answer);
    ExpectBack(ImageStatusRequest{{random.Seq(), random.Text()}, random.Session()});
    ImageStatus status;
    status.session = random.Session();
    status.num_stored = random.Int(0, 1000);
    status.num_awaited = random.Int(0, 1000);
    status.num_lost = random.Int(0, 1000);
    status.awaited = random.List<ImageStatus::Awaited>(9, [&] {
      return ImageStatus::Awaited{KeyframeId(random.Int(0, 1000)), random.Int(0, 1000)};
    });
    ExpectBack(status);
  }
}

TEST(ImageCodec, WhatCannotBeIsRefused) {
  RandomValues random(4);
  const auto refuses = [&](const std::function<void(ImagePiece*)>& spoil) {
    ImagePiece piece{RandomImage(&random), 0, 0, 0};
    piece.size = static_cast<int>(piece.image.bytes.size());
    spoil(&piece);
    const std::vector<uint8_t> data = Encode(piece);
    return !Decode<ImagePiece>(data.data(), static_cast<int>(data.size())).value;
  };
  EXPECT_FALSE(refuses([](ImagePiece*) {}));
  EXPECT_TRUE(refuses([](ImagePiece* p) { p->image.encoding = "gif"; }));
  EXPECT_TRUE(refuses([](ImagePiece* p) { p->image.encoding = ""; }));
  EXPECT_TRUE(refuses([](ImagePiece* p) { p->size -= 1; }));
  EXPECT_TRUE(refuses([](ImagePiece* p) { p->size = kMaxImageBytes + 1; }));
  EXPECT_TRUE(refuses([](ImagePiece* p) { p->offset = 1; }));
  EXPECT_TRUE(refuses([](ImagePiece* p) { p->offset = -1; }));
  EXPECT_TRUE(refuses([](ImagePiece* p) { p->image.bytes.clear(); }));
  EXPECT_TRUE(refuses([](ImagePiece* p) { p->image.width = 0; }));
  ImageRequest request;
  request.wanted = {{KeyframeId(1), 2, -3}};
  const std::vector<uint8_t> data = Encode(request);
  EXPECT_FALSE(Decode<ImageRequest>(data.data(), static_cast<int>(data.size())).value);
}

}  // namespace image_codec_test
}  // namespace mapmend
