#include "procs/frontend/run_options.h"

#include <cstdio>
#include <filesystem>
#include <nlohmann/json.hpp>

namespace mapmend {
namespace {

// FNV-1a, 64 bit.
uint64_t Fnv1a(const std::string& text, uint64_t hash) {
  for (const unsigned char c : text) hash = (hash ^ c) * 0x100000001b3ULL;
  return hash;
}

}  // namespace

std::string ToJson(const RunOptions& options) {
  const FrontendOptions& f = options.frontend;
  const nlohmann::json json = {
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
  return json.dump();
}

std::string SessionForFile(const RunOptions& options) {
  namespace fs = std::filesystem;
  const fs::path input(options.input);
  std::error_code ignored;
  const auto size = fs::is_regular_file(input) ? fs::file_size(input, ignored) : 0;
  const std::string text = fs::weakly_canonical(input, ignored).filename().string() + "|" + std::to_string(size) + "|" +
                           options.vehicle + "|" + ToJson(options);
  const uint64_t high = Fnv1a(text, 0xcbf29ce484222325ULL), low = Fnv1a(text, high);
  // The layout of a UUID of version 8 (custom, RFC 9562).
  char uuid[37];
  std::snprintf(uuid, sizeof(uuid), "%08x-%04x-8%03x-%04x-%012llx", static_cast<unsigned>(high >> 32),
                static_cast<unsigned>(high >> 16 & 0xffff), static_cast<unsigned>(high & 0xfff),
                static_cast<unsigned>(0x8000 | (low >> 48 & 0x3fff)),
                static_cast<unsigned long long>(low & 0xffffffffffffULL));
  return uuid;
}

}  // namespace mapmend
