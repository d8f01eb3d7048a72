#include "procs/frontend/run_options.h"

#include <cmath>
#include <nlohmann/json.hpp>

#include "libs/base/write_file.h"
#include "libs/capture/fingerprint.h"
#include "libs/stream/session_id.h"

namespace mapmend {

std::string ToJson(const RunOptions& options) {
  const FrontendOptions& f = options.frontend;
  nlohmann::json json = {
      {"num_features", options.num_features},
      {"max_dimension", options.max_dimension},
      {"seed", options.seed},
      {"skip_frames", options.skip_frames},
      {"max_lost_frames", f.max_lost_frames},
      {"relocalisation_frames", f.relocalisation_frames},
      {"keyframe_ratio", f.keyframes.min_shared},
      {"min_inliers", f.tracker.min_inliers},
      {"bundle_keyframes", f.mapper.bundle_keyframes},
  };
  if (options.every != 1) json["every"] = options.every;
  if (options.start_s > 0) json["start_s"] = options.start_s;
  if (std::isfinite(options.end_s)) json["end_s"] = options.end_s;
  if (options.mode != InputMode::kLockstep) json["mode"] = ModeName(options.mode);
  if (options.mode != InputMode::kLive && options.image_channel != channels::kImage)
    json["image_channel"] = options.image_channel;
  if (f.wide.num_keyframes != WideFeaturesOptions().num_keyframes) json["wide_keyframes"] = f.wide.num_keyframes;
  if (!options.mask_path.empty()) json["mask"] = SessionIdFromText(ReadFile(options.mask_path));
  if (!options.continues.empty()) {
    json["continues"] = options.continues;
    json["first_frame"] = options.first_frame;
  }
  return json.dump();
}

std::string ModeName(InputMode mode) {
  return mode == InputMode::kLive ? "live" : mode == InputMode::kRealtime ? "realtime" : "lockstep";
}

std::string SessionForFile(const RunOptions& options) {
  const std::string text = ContentFingerprint(options.inputs) + "|" + options.vehicle + "|" + ToJson(options);
  return SessionIdFromText(text);
}

}  // namespace mapmend
