// Tracks one camera: images in, keyframes and loss events out (paper §3.1, §3.2).

#include <spdlog/spdlog.h>
#include <unistd.h>

#include <CLI/CLI.hpp>

#include "libs/command_line/command_line.h"
#include "libs/command_line/option_flags.h"
#include "libs/image_messages/image_log.h"
#include "procs/frontend/run_options.h"

namespace {

// How the input is read, as told by flags.
struct PaceFlags {
  bool realtime = false, live = false, lockstep = false;
};

void AddInputOptions(CLI::App& app, mapmend::RunOptions& options) {
  app.add_option("input", options.inputs,
                 "video files, folders of images, images, or logs of lcm-logger: one flight; none with --live");
  app.add_option("--camera", options.camera_path, "calibration, in any format of data/cameras/README.md")->required();
  app.add_option("--mask", options.mask_path, "image, black where no features may be, or YAML with mask_rectangles");
  app.add_option("--gps", options.gps_path,
                 "positions of the vehicle (table, GPX, NMEA, DJI subtitles, geo.txt), or exif, or none; else from the "
                 "photos, or from subtitles beside the video");
  app.add_option("--gps-origin", options.gps_origin,
                 "LATITUDE,LONGITUDE,ALTITUDE of positions that are told east, north, up from there");
  app.add_option("--times", options.times_path, "time of each frame, one per line; else from the frame rate");
  app.add_option("--vocabulary", options.vocabulary_path, "vocabulary (mapmend's or DBoW2's text format)")->required();
  app.add_option("--skip-frames", options.skip_frames, "frames to leave out, e.g. 80-120,200-240");
  app.add_option("--every", options.every, "only each so manyth frame")->check(CLI::Range(1, 100000));
  app.add_option("--start", options.start_s, "only frames from so many seconds after the first one on")
      ->check(CLI::Range(0.0, 1e9));
  app.add_option("--end", options.end_s, "only frames before so many seconds after the first one")
      ->check(CLI::Range(0.0, 1e9));
  app.add_option("--features", options.num_features, "ORB features per image; 0: 1000 up to one megapixel, 2000 above")
      ->capture_default_str();
  app.add_option("--max-dimension", options.max_dimension, "scale larger images down to this many pixels; 0: never")
      ->capture_default_str();
}

void AddPaceOptions(CLI::App& app, PaceFlags& pace, mapmend::RunOptions& options) {
  auto* lockstep_flag =
      app.add_flag("--lockstep", pace.lockstep,
                   "every frame of the input, however long it takes: the same map each time (the default)");
  auto* realtime_flag =
      app.add_flag("--realtime", pace.realtime,
                   "play the input at the pace of its times; frames that come while tracking is busy are dropped");
  auto* live_flag =
      app.add_flag("--live", pace.live,
                   "images come over the bus, channel MAPMEND_IMAGE, until the camera ends the stream, or Ctrl-C");
  app.add_option(
      "--source", options.source,
      "with --live: /dev/video0, rtsp://..., gst:PIPELINE, or a folder into which a camera writes; else the bus");
  app.add_option("--image-channel", options.image_channel,
                 "with --live or a log: channel of mapmend's or bot_core's image_t")
      ->capture_default_str();
  realtime_flag->excludes(lockstep_flag);
  live_flag->excludes(lockstep_flag)->excludes(realtime_flag);
  app.add_option("--speed", options.speed, "with --realtime: times as fast as the frames were taken")
      ->check(CLI::Range(0.001, 1e6))
      ->capture_default_str();
  app.add_option("--max-waiting", options.max_waiting,
                 "with --realtime or --live: frames that may wait before the oldest is dropped")
      ->check(CLI::Range(1, 1000))
      ->capture_default_str();
}

void AddStreamOptions(CLI::App& app, mapmend::RunOptions& options) {
  app.add_option("--profile", options.profile_path,
                 "write the time of each stage per frame to this JSON file, and print it");
  app.add_option("--events", options.events_path, "file that gets a JSON line for each loss and each submap");
  app.add_option("--local-url", options.local_url,
                 "LCM network on board, if --lcm-url is that of a station: images come over it, health goes to both");
  app.add_option("--seed", options.seed, "of all random sampling")->capture_default_str();
  app.add_option("--session", options.session, "name of the session (UUID); else made from input, options and seed");
  app.add_option("--outbox", options.outbox_path, "file that keeps what the store has not acknowledged");
  app.add_option("--deliver-timeout", options.deliver_timeout_s,
                 "at the end, how long to wait without progress for a lost link or a silent store, seconds")
      ->check(CLI::Range(0, 1000000))
      ->capture_default_str();
  app.add_flag(
      "--resume", options.resume,
      "an earlier frontend of this session may have died: ask the store how far it came, and go on from there");
  app.add_option("--continues", options.continues,
                 "session of the same flight that has ended; frames before --first-frame are in it");
  app.add_option("--first-frame", options.first_frame, "of a file: those before are passed over")
      ->check(CLI::NonNegativeNumber);
  app.add_option("--vehicle", options.vehicle, "name of the vehicle, for the record");
}

void AddImageOptions(CLI::App& app, mapmend::RunOptions& options) {
  app.add_option(
      "--images", options.images.keep,
      "of keyframes, for the map: full, none, or a width in pixels to which larger ones are scaled (default: "
      "full for files, 640 of a camera)");
  app.add_option("--image-quality", options.images.quality,
                 "of the JPEG of what did not come as one, 1 to 100; 0: PNG, without loss")
      ->check(CLI::Range(0, 100))
      ->capture_default_str();
  app.add_option("--image-rate", options.images.rate_kbit_s,
                 "images take at most so much of the link, kbit/s; 0: no limit (default: none on this host, else 4000)")
      ->check(CLI::Range(0, 100000000));
}

void AddTrackingOptions(CLI::App& app, mapmend::RunOptions& options) {
  app.add_option("--lost-frames", options.frontend.max_lost_frames,
                 "consecutive frames without orientation that end a submap")
      ->capture_default_str();
  app.add_option("--relocalisation-frames", options.frontend.relocalisation_frames,
                 "further frames in which a lost submap may be found again")
      ->capture_default_str();
  app.add_flag("--relocalise-only", options.frontend.relocalise_only,
               "after a loss begin no new submap, but wait until the camera sees the map again, as ORB-SLAM2 does");
  app.add_option("--wide-keyframes", options.frontend.wide.num_keyframes,
                 "first and last keyframes of a submap whose SIFT features are kept, for gaps that ORB cannot bridge; "
                 "0: none")
      ->check(CLI::Range(0, 100))
      ->capture_default_str();
}

int Run(int argc, char** argv) {
  mapmend::RunOptions options;
  PaceFlags pace;
  CLI::App app("frontend: tracks one camera and publishes keyframes, map updates and loss events.", "frontend");
  mapmend::AddProcessOptions(&app, &options.process);
  AddInputOptions(app, options);
  AddPaceOptions(app, pace, options);
  AddStreamOptions(app, options);
  AddImageOptions(app, options);
  AddTrackingOptions(app, options);
  mapmend::AddOptionFlags(&app, "frontend", &options);
  if (const auto code = mapmend::ParseCommandLine(&app, argc, argv)) return *code;
  mapmend::RequireGoodOptions(mapmend::OptionList::Of(options));
  options.mode = pace.live       ? mapmend::InputMode::kLive
                 : pace.realtime ? mapmend::InputMode::kRealtime
                                 : mapmend::InputMode::kLockstep;
  mapmend::ApplyLogLevel(options.process);
  mapmend::InstallSignalHandlers();
  if (options.mode == mapmend::InputMode::kLockstep) {
    // Whoever reads as fast as the machine allows leaves the first turn to those who have to keep up.
    constexpr int kNicer = 3;
    if (nice(kNicer) < 0) spdlog::debug("frontend: cannot lower its priority");
  }
  options.inputs = mapmend::ExpandLogs(options.inputs);
  return mapmend::RunFrontend(options);
}

}  // namespace

int main(int argc, char** argv) { return mapmend::RunMain("frontend", Run, argc, argv); }
