#pragma once

#include <optional>
#include <string>
#include <vector>

// What `mapmend run` was asked to do, and what the checks of its inputs found out.
#include "procs/mapmend/export_settings.h"
#include "procs/mapmend/process_settings.h"

namespace mapmend {

struct RunOptions {
  // Video files, folders of images, images or logs of lcm-logger, one flight; empty with live.
  std::vector<std::string> inputs;
  std::string camera;       // empty: camera.yaml beside the input
  std::string times;        // empty: times.txt beside the input if there is one, else the video's own times
  std::string images;       // of keyframes: full, none or a width; empty: the frontend's default
  std::string gps;          // file of positions, "exif" or "none"; empty: of the photos, or beside the video, if any
  std::string gps_origin;   // LATITUDE,LONGITUDE,ALTITUDE of positions that are told east, north, up; empty: none
  std::string mask;         // image or rectangles where no features may be; empty: none
  std::string out;          // empty: ./mapmend-<name of the input>
  std::string vocabulary;   // empty: mapmend's own
  std::string groundtruth;  // empty: none
  std::optional<double> time_offset, time_tolerance;  // of the ground truth, seconds; unset: 0 and the viewer's
  std::string groundtruth_origin;                     // LATITUDE,LONGITUDE,ALTITUDE; empty: the first position
  std::string record;                                 // folder for a log of the stream; empty: none
  std::string skip_frames;                            // e.g. 80-120,200-240
  std::string session;                                // UUID; empty: made from input and options, new with append
  std::string vehicle;
  std::string title;    // of the report; empty: the name of the folder
  std::string lcm_url;  // empty: LCM_DEFAULT_URL, else a private hub on a free port
  std::string channel_prefix;
  std::string log_level = "info";
  std::optional<int> seed, features, max_dimension;  // unset: the processes' own defaults
  std::optional<int> lost_frames,
      relocalisation_frames;                     // of the loss criterion (paper, 3.2); unset: the frontend's own
  std::optional<int> port;                       // of the live page; unset: a free one from 8080 on; 0: no page
  std::optional<int> image_quality, image_rate;  // of JPEG; kbit/s
  std::optional<int> every;                      // only each so manyth frame
  std::optional<double> start, end;              // only frames of this time, seconds since the first frame
  bool overwrite = false;                        // replace the results of an earlier run in out
  bool realtime = false;                         // play the input at its own pace, drop what comes too fast
  std::string source;                            // with live: device, URL, pipeline or growing folder; empty: the bus
  std::string image_channel;                     // with live or a log: of the images; empty: MAPMEND_IMAGE
  bool follow = false;                           // INPUT is a growing folder: live, with that as the source
  bool live = false;                             // images come over the bus
  std::optional<double> speed;                   // with realtime; unset: 1
  std::optional<int> max_waiting;                // with realtime or live: frames that may wait; unset: the frontend's
  bool profile = false;                          // time of each stage of the frontend, in the summary
  bool append = false;                           // map this flight into the map that is already in out
  bool continue_flight = false;                  // go on with the flight that was cut off in out
  bool quiet = false;                            // nothing on standard output
  bool json = false;                             // nothing but the summary as JSON on standard output
  std::string bind;                              // address of the live page; empty: this host only
  ExportSettings exports;                        // formats, frame
  ProcessSettings settings;                      // of the processes
};

struct RunInputs {
  RunOptions options;  // with every default filled in
  std::string vocabulary_hash;
  std::string guessed_camera;      // content of options.camera if that file is still to be written; else empty
  int num_frames = 0;              // about so many, for a progress line; 0 if nobody knows
  std::vector<std::string> notes;  // lines for the user, e.g. which camera file was taken
};

// --follow FOLDER is short for --live --source FOLDER. Throws UsageError if there is not just one INPUT.
void ApplyFollow(RunOptions* options);

// Checks everything that can be checked before a process is started. Changes nothing on disk.
// Throws std::runtime_error with one line that names the file or option and says what to do.
RunInputs CheckRunInputs(const RunOptions& options);

}  // namespace mapmend
