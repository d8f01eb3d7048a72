#include "procs/mapmend/frontend_arguments.h"

#include "procs/mapmend/paths.h"

namespace mapmend {

std::string ProfilePath(const RunOptions& options) { return options.out + "/logs/profile.json"; }

std::string EventsPath(const RunOptions& options) { return options.out + "/events.jsonl"; }

std::vector<std::string> FrontendArguments(const RunOptions& options, const std::string& session) {
  std::vector<std::string> argv = {FindProgram("frontend"),
                                   "--camera",
                                   options.camera,
                                   "--vocabulary",
                                   options.vocabulary,
                                   "--session",
                                   session,
                                   "--outbox",
                                   options.out + "/outbox",
                                   "--events",
                                   EventsPath(options)};
  if (options.live) argv.push_back("--live");
  argv.insert(argv.end(), options.inputs.begin(), options.inputs.end());
  if (options.realtime) argv.push_back("--realtime");
  const auto add = [&](const char* name, const std::string& value) {
    if (!value.empty()) argv.insert(argv.end(), {name, value});
  };
  const auto add_number = [&](const char* name, const std::optional<int>& value) {
    if (value) argv.insert(argv.end(), {name, std::to_string(*value)});
  };
  add("--source", options.source);
  add("--image-channel", options.image_channel);
  add("--times", options.times);
  add("--gps", options.gps);
  add("--gps-origin", options.gps_origin);
  add("--mask", options.mask);
  add("--images", options.images);
  add_number("--image-quality", options.image_quality);
  add_number("--image-rate", options.image_rate);
  add("--skip-frames", options.skip_frames);
  add("--vehicle", options.vehicle);
  if (options.profile) add("--profile", ProfilePath(options));
  if (options.speed) add("--speed", std::to_string(*options.speed));
  add_number("--every", options.every);
  if (options.start) add("--start", std::to_string(*options.start));
  if (options.end) add("--end", std::to_string(*options.end));
  add_number("--max-waiting", options.max_waiting);
  add_number("--seed", options.seed);
  add_number("--features", options.features);
  add_number("--max-dimension", options.max_dimension);
  add_number("--lost-frames", options.lost_frames);
  add_number("--relocalisation-frames", options.relocalisation_frames);
  return argv;
}

}  // namespace mapmend
