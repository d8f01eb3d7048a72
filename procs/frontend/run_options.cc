#include "procs/frontend/run_options.h"

#include <cmath>
#include <iterator>
#include <nlohmann/json.hpp>

#include "libs/base/options.h"
#include "libs/base/write_file.h"
#include "libs/capture/fingerprint.h"
#include "libs/stream/session_id.h"

namespace mapmend {

namespace {

// Told by ToJson whether they differ from their defaults or not, or by a name of their own.
constexpr const char* kToldApart[] = {"num_features",
                                      "max_dimension",
                                      "seed",
                                      "skip_frames",
                                      "every",
                                      "start_s",
                                      "end_s",
                                      "max_lost_frames",
                                      "relocalisation_frames",
                                      "keyframes.min_shared",
                                      "wide.num_keyframes",
                                      "tracker.min_inliers",
                                      "mapper.bundle_keyframes"};

nlohmann::json OtherChanges(RunOptions options) {
  RunOptions defaults;
  nlohmann::json changes = nlohmann::json::parse(ChangesToJson(OptionList::Of(options), OptionList::Of(defaults)));
  for (const char* told : kToldApart) changes.erase(told);
  for (auto it = changes.begin(); it != changes.end();)
    it = ChangesStream(it.key()) ? std::next(it) : changes.erase(it);
  return changes;
}

}  // namespace

bool ChangesStream(const std::string& option) {
  return option != "deliver_timeout_s" && !option.starts_with("sender.") && !option.starts_with("images.");
}

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
  if (options.gps_path == "none" || options.gps_path == "exif") {
    json["gps"] = options.gps_path;
  } else if (!options.gps_path.empty()) {
    json["gps"] = SessionIdFromText(ReadFile(options.gps_path) + options.gps_origin);
  }
  if (!options.continues.empty()) {
    json["continues"] = options.continues;
    json["first_frame"] = options.first_frame;
  }
  if (const nlohmann::json changes = OtherChanges(options); !changes.empty()) json["options"] = changes;
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
