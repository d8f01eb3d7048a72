#include "procs/mosaic/live_exposure.h"

namespace mapmend {
namespace {

constexpr double kGrowth = 1.25;  // before it is worked out anew
constexpr int kFirst = 3;         // images at least

}  // namespace

void LiveExposure::Apply(const std::string& name, const std::vector<cv::Mat>& brightness, bool is_final,
                         GroundScene* scene) {
  Part& part = parts_[name];
  const int count = scene->NumImages();
  if (is_final || (count >= kFirst && count >= kGrowth * part.num_images)) {
    const Exposure exposure = EvenBrightness(*scene, brightness, options_);
    part.num_images = count;
    part.a = exposure.a;
    part.b = exposure.b;
    part.gains.clear();
    for (int i = 0; i < count; ++i) part.gains[scene->Image(i).id] = exposure.gains[static_cast<size_t>(i)];
  }
  Exposure exposure;
  exposure.a = part.a;
  exposure.b = part.b;
  std::array<float, 3> last = {1, 1, 1};
  for (int i = 0; i < count; ++i) {
    const auto known = part.gains.find(scene->Image(i).id);
    if (known != part.gains.end()) last = known->second;
    exposure.gains.push_back(last);
  }
  scene->SetExposure(std::move(exposure));
}

}  // namespace mapmend
