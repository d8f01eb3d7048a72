#include "procs/frontend/run_options.h"

#include <filesystem>
#include <nlohmann/json.hpp>

#include "libs/mapping/session_id.h"

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
      {"keyframe_ratio", f.keyframe_ratio},
      {"min_inliers", f.tracker.min_inliers},
      {"bundle_keyframes", f.mapper.bundle_keyframes},
  };
  if (options.mode != InputMode::kLockstep) json["mode"] = ModeName(options.mode);
  return json.dump();
}

std::string ModeName(InputMode mode) {
  return mode == InputMode::kLive ? "live" : mode == InputMode::kRealtime ? "realtime" : "lockstep";
}

std::string SessionForFile(const RunOptions& options) {
  namespace fs = std::filesystem;
  const fs::path input(options.input);
  std::error_code ignored;
  const auto size = fs::is_regular_file(input) ? fs::file_size(input, ignored) : 0;
  const std::string text = fs::weakly_canonical(input, ignored).filename().string() + "|" + std::to_string(size) + "|" +
                           options.vehicle + "|" + ToJson(options);
  return SessionIdFromText(text);
}

}  // namespace mapmend
