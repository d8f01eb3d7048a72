#include <CLI/CLI.hpp>
#include <cstdlib>
#include <memory>
#include <string>

#include "libs/bus/bus.h"
#include "procs/mapmend/bus_plan.h"
#include "procs/mapmend/commands.h"
#include "procs/mapmend/run_flight.h"

namespace mapmend {

namespace {

// What is read: images, their times, the camera, positions, and which part of them.
void AddInputOptions(CLI::App* sub, RunOptions* options) {
  sub->add_option("INPUT", options->inputs,
                  "video file, folder of images taken in the order of their names, or log of lcm-logger with images on "
                  "--image-channel (or the folder of its parts); several are the parts of one flight, in order; none "
                  "with --live");
  sub->add_option("--camera", options->camera,
                  "calibration, in any format of data/cameras/README.md (default: camera.yaml beside INPUT)");
  sub->add_option("--times", options->times,
                  "one time per line and frame (default: times.txt beside INPUT, else the video's own times)");
  sub->add_option(
      "--gps", options->gps,
      "positions of the vehicle: a table (of mapmend simulate, exiftool -csv, ...), GPX, NMEA, DJI "
      "subtitles, geo.txt of OpenDroneMap; or exif, or none (default: of the photos, or of subtitles beside "
      "the video, if they tell any; with --live what comes on MAPMEND_GPS)");
  sub->add_option("--gps-origin", options->gps_origin,
                  "LATITUDE,LONGITUDE,ALTITUDE that positions are told from as rows of time, east, north, up");
  sub->add_option("--vocabulary", options->vocabulary, "mapmend's format or DBoW2 text (default: mapmend's own)");
  sub->add_option("--skip-frames", options->skip_frames,
                  "frames to leave out, to simulate interruptions, e.g. 80-120,200-240");
  sub->add_option("--every", options->every, "map only each so manyth frame")->check(CLI::Range(1, 100000));
  sub->add_option("--start", options->start, "leave out what is earlier, seconds after the first frame")
      ->check(CLI::Range(0.0, 1e9));
  sub->add_option("--end", options->end, "leave out what is later, seconds after the first frame")
      ->check(CLI::Range(0.0, 1e9));
}

void AddTrackingOptions(CLI::App* sub, RunOptions* options) {
  sub->add_option("--features", options->features,
                  "features per frame (default: 1000 up to one megapixel, 2000 above)");
  sub->add_option("--max-dimension", options->max_dimension,
                  "larger images are scaled down to this width or height, pixels; 0: never (default: 0)");
  sub->add_option("--lost-frames", options->lost_frames,
                  "consecutive frames without orientation that end a submap (default: 3)")
      ->check(CLI::Range(1, 100000));
  sub->add_option(
         "--relocalisation-frames", options->relocalisation_frames,
         "further frames in which a lost submap may be found again, unless a new one begins before (default: 10)")
      ->check(CLI::Range(0, 100000));
  sub->add_option_function<std::string>(
         "--mode",
         [options](const std::string& mode) {
           if (mode == "relocalise-only") options->settings.Set("frontend.relocalise_only=true");
         },
         "after a loss: submaps begins a new one at once; relocalise-only waits until the camera sees the map again, "
         "as ORB-SLAM2 does, for comparison (default: submaps)")
      ->check(CLI::IsMember({"submaps", "relocalise-only"}));
  sub->add_option("--seed", options->seed, "of everything random; the same seed gives the same map (default: 1)");
}

// How images come: all of a file, a file as if it were a camera, a camera.
void AddPaceOptions(CLI::App* sub, RunOptions* options) {
  const auto lockstep = std::make_shared<bool>(false);
  auto* lockstep_flag = sub->add_flag(
      "--lockstep", [lockstep](int64_t) { *lockstep = true; },
      "every frame of INPUT, however long it takes: the same map each time (the default)");
  auto* realtime_flag = sub->add_flag(
      "--realtime", options->realtime,
      "play INPUT at the pace of its times; frames that come while tracking is busy are dropped, and counted");
  auto* live_flag = sub->add_flag(
      "--live", options->live,
      "images come over the bus (channel MAPMEND_IMAGE, e.g. from `mapmend publish`) until the camera ends the "
      "stream, or Ctrl-C; frames that come while tracking is busy are dropped, and counted");
  sub->add_option(
      "--source", options->source,
      "with --live: a camera that is read directly: /dev/video0, rtsp://..., gst:PIPELINE of GStreamer, or a "
      "folder into which images are written; it is waited for when it goes away");
  sub->add_flag("--follow", options->follow,
                "INPUT is a folder into which images are still written: map each as it comes, until Ctrl-C");
  sub->add_option("--image-channel", options->image_channel,
                  "with --live or a log: channel of the images, image_t of mapmend or of bot_core (default: "
                  "MAPMEND_IMAGE)");
  realtime_flag->excludes(lockstep_flag);
  live_flag->excludes(lockstep_flag)->excludes(realtime_flag);
  sub->add_option("--speed", options->speed, "with --realtime: times as fast as the frames were taken (default: 1)")
      ->check(CLI::Range(0.001, 1e6));
  sub->add_option("--max-waiting", options->max_waiting,
                  "with --realtime or --live: frames that may wait before the oldest is dropped (default: 3)")
      ->check(CLI::Range(1, 1000));
}

void AddKeptImageOptions(CLI::App* sub, RunOptions* options) {
  sub->add_option("--images", options->images,
                  "of keyframes, kept for the map: full, none, or a width in pixels to which larger ones are scaled "
                  "(default: full for files, 640 of a camera)")
      ->check([](const std::string& text) -> std::string {
        const bool is_width = text.size() <= 5 && text.find_first_not_of("0123456789") == std::string::npos;
        if (text == "full" || text == "none" || (is_width && std::atoi(text.c_str()) >= 16)) return "";
        return "'" + text + "': known are full, none, and a width in pixels, 16 or more";
      });
  sub->add_option("--image-quality", options->image_quality,
                  "of the JPEG of what did not come as one, 1 to 100; 0: PNG, without loss (default: 90)")
      ->check(CLI::Range(0, 100));
  sub->add_option(
         "--image-rate", options->image_rate,
         "images take at most so much of the link, kbit/s; 0: no limit (default: none on this host, else 4000)")
      ->check(CLI::Range(0, 100000000));
}

}  // namespace

void AddFlightOptions(CLI::App* sub, RunOptions* options) {
  AddInputOptions(sub, options);
  AddTrackingOptions(sub, options);
  AddPaceOptions(sub, options);
  AddKeptImageOptions(sub, options);
  sub->add_option("--session", options->session,
                  "id of this flight in the map, a UUID (default: made from input and options; new with --append)");
}

void AddRunCommand(CLI::App* app) {
  CLI::App* sub = app->add_subcommand("run", "Map one flight: a video or a folder of images becomes one merged map");
  const auto options = std::make_shared<RunOptions>();
  AddFlightOptions(sub, options.get());
  sub->add_option("--mask", options->mask,
                  "where no features may be (on-screen text, propellers, bonnet): an image of the frames' shape, black "
                  "there, or YAML with mask_rectangles");
  sub->add_option("--out", options->out, "folder of the results (default: ./mapmend-<name of INPUT>)");
  auto* overwrite = sub->add_flag("--overwrite", options->overwrite, "replace the results of an earlier run in --out");
  auto* append = sub->add_flag("--append", options->append, "map this flight into the map that is already in --out");
  sub->add_flag(
         "--continue", options->continue_flight,
         "go on with this flight, which was cut off (power, Ctrl-C), from the first frame that is not in --out yet")
      ->excludes(append)
      ->excludes(overwrite);
  sub->add_option(
      "--groundtruth", options->groundtruth,
      "trajectory to compare the map with (TUM, EuRoC, KITTI with --times, or positions t x y z); the report "
      "then tells the accuracy");
  sub->add_option("--time-offset", options->time_offset, "seconds to add to the times of the ground truth");
  sub->add_option("--time-tolerance", options->time_tolerance,
                  "largest difference in time of poses compared with the ground truth, seconds (default: 0.01)")
      ->check(CLI::Range(0.0, 1e6));
  options->exports.AddOptions(sub);
  options->exports.AddMosaicOption(sub);
  sub->add_option(
      "--groundtruth-origin", options->groundtruth_origin,
      "LATITUDE,LONGITUDE,ALTITUDE of a ground truth that is east, north, up (default: the one in its head, "
      "else the first position)");
  sub->add_option("--record", options->record, "folder: lcm-logger writes mapmend.lcmlog there, for `mapmend replay`");
  sub->add_flag("--profile", options->profile,
                "print the frontend's time per frame for each stage; also in summary.json and the report");
  sub->add_option("--port", options->port, "of the live page, 0: none (default: a free one from 8080 on)");
  sub->add_option("--bind", options->bind,
                  "address on which the live page listens; 0.0.0.0: everybody in the network sees it (default: "
                  "127.0.0.1, this machine only)");
  sub->add_option("--vehicle", options->vehicle, "name of the camera's carrier, for the report");
  sub->add_option("--title", options->title, "of the report (default: the name of the folder --out)");
  auto* quiet_flag = sub->add_flag("--quiet", options->quiet, "print nothing but errors");
  sub->add_flag("--json", options->json, "print nothing but the summary at the end, as JSON")->excludes(quiet_flag);
  AddBusOptions(sub, &options->lcm_url, &options->channel_prefix, &options->log_level);
  options->settings.AddFlags(sub, {"frontend", "hub", "submap_store", "merger", "viewer_export", "mosaic"});
  sub->footer(
      "Exit codes: 0 done; 1 an error, told in one line; 2 a mistake in the command line; 3 INPUT ends early, or\n"
      "frames of it could not be used (the rest is mapped); 4 mapped, but the main map holds less than half of the "
      "flight (the last "
      "line\nsays why and what to try); 130 interrupted (map.db holds what was mapped so far). With --live the first "
      "Ctrl-C\nends the flight: the map is finished.");
  sub->callback([options] {
    options->exports.Check();
    options->settings.Resolve();
    options->lcm_url = UrlFromOptionOrEnvironment(options->lcm_url);
    ApplyFollow(options.get());
    // A camera cannot know the port of a private hub.
    if (options->live && options->source.empty() && options->lcm_url.empty()) options->lcm_url = ResolveLcmUrl("");
    const int code = RunFlight(CheckRunInputs(*options));
    if (code != 0) throw CLI::RuntimeError(code);
  });
}

}  // namespace mapmend
