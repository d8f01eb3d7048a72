#pragma once

#include <limits>
#include <string>
#include <vector>

#include "libs/bus/channels.h"
#include "libs/bus/process.h"
#include "libs/features/orb_extractor.h"
#include "libs/wire/stream_sender.h"
#include "procs/frontend/frontend.h"
#include "procs/frontend/image_options.h"

namespace mapmend {

// How images come: all of a file, one after the other (lockstep: the result does not depend on timing); a file at the
// pace of its times; a camera on the bus. In the last two, images that come while the frontend is busy are dropped.
enum class InputMode { kLockstep, kRealtime, kLive };

// OrbOptions as a group without the number of features.
struct OrbCorners {
  OrbOptions* orb;
  template <typename Visitor>
  void Visit(Visitor& v) {
    orb->VisitCorners(v);
  }
};

// The frontend's command line.
struct RunOptions {
  ProcessOptions process;
  std::vector<std::string> inputs;
  std::string camera_path, times_path, vocabulary_path, skip_frames, session, outbox_path, vehicle;
  // Positions of the vehicle, see ReadPositions; "exif": from the photos; "none"; empty: from the photos or from
  // subtitles beside the video, if they tell any.
  std::string gps_path, gps_origin;
  std::string mask_path;                                   // see ReadMask; empty: none
  int every = 1;                                           // of a file: only each so manyth frame
  double start_s = 0;                                      // only frames from so many seconds on ...
  double end_s = std::numeric_limits<double>::infinity();  // ... and before this, counted from the first frame
  int num_features = 0;                                    // per image; 0: 1000 up to one megapixel, 2000 above
  int max_dimension = 0;                                   // pixels; larger images are scaled down; 0: never
  uint64_t seed = 1;
  std::string events_path;  // file that gets a JSON line for each loss, submap, end; empty: none
  // A second LCM network, on board: live images come over it, and health goes to it as well; empty: there is none. The
  // stream goes over process.lcm_url alone.
  std::string local_url;
  std::string profile_path;  // JSON file for the time of each stage; empty: none
  InputMode mode = InputMode::kLockstep;
  // kLive: a camera that is read here (device_images.h), or a folder into which one writes; empty: images come over the
  // bus, on image_channel. That is the channel in a log of lcm-logger, too, that is an input.
  std::string source, image_channel = channels::kImage;
  double speed = 1;     // kRealtime: times as fast as the images were taken
  int max_waiting = 3;  // kRealtime, kLive: images that may wait for the frontend
  // At the end of the flight: so long without progress it waits for a link or a silent store, seconds.
  int deliver_timeout_s = 300;
  bool resume = false;    // an earlier frontend of the session may have died: ask the store how far it came
  std::string continues;  // an ended session of the same flight, whose frames before first_frame are in the map
  int first_frame = 0;    // of a file: those before are passed over
  FrontendOptions frontend;
  OrbOptions orb;              // but for num_features, which is told above
  StreamSenderOptions sender;  // but for outbox_path
  ImageOptions images;

  // What may change the stream first, then how it is delivered. Not visited: process, inputs, camera_path, times_path,
  // vocabulary_path, session, outbox_path, vehicle, gps_path, gps_origin, mask_path, events_path, local_url,
  // profile_path, mode, source, image_channel, resume, continues, first_frame: they say which flight it is, and where
  // everything lies.
  template <typename Visitor>
  void Visit(Visitor& v) {
    frontend.Visit(v);
    OrbCorners corners{&orb};
    v("orb", corners);
    v("num_features", num_features, Range(0, 100000), "per image; 0: 1000 up to one megapixel, 2000 above");
    v("max_dimension", max_dimension, Range(0, 100000), "pixels; 0: images as they are");
    v("seed", seed);
    v("skip_frames", skip_frames);
    v("every", every, Range(1, 100000), "frames");
    v("start_s", start_s, AtLeast(0), "s");
    v("end_s", end_s, AtLeast(0), "s");
    v("speed", speed, Range(0.001, 1e6), "times real time");
    v("max_waiting", max_waiting, Range(1, 1000), "frames");
    v("sender", sender);
    v("images", images);
    v("deliver_timeout_s", deliver_timeout_s, Range(0, 1e6), "s");
  }
  // Empty, or which options contradict each other.
  std::string Conflict() const { return orb.Conflict().empty() ? images.Conflict() : orb.Conflict(); }
};

// Whether an option of RunOptions may change the stream; the others only concern its delivery.
bool ChangesStream(const std::string& option);

// Every option that may change the stream as JSON, for the record in the session's first message: a few by names of
// their own, all others under "options" where they differ from their defaults, which are those of the program's
// version.
std::string ToJson(const RunOptions& options);

// A session's name for a file: the same content, options and seed give the same UUID, so that a run can be repeated bit
// for bit.
std::string SessionForFile(const RunOptions& options);

// "lockstep", "realtime" or "live".
std::string ModeName(InputMode mode);

// Runs the frontend on its input until the end, or until a signal asks it to stop. Returns the process's exit code: 0,
// or 3 if not all of the input could be used (what could is mapped).
int RunFrontend(const RunOptions& options);

}  // namespace mapmend
