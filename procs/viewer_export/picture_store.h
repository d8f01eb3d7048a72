#pragma once

#include <functional>

#include "libs/map_view/image_source.h"

namespace mapmend {

class StoreClient;

// What a store has for pictures. One that once does not answer is not asked again: to wait for each image would take
// hours. The client must outlive what is returned.
//   tick  called before each question; may be empty
PictureSource PicturesOf(StoreClient* store, std::function<void()> tick = {});

}  // namespace mapmend
