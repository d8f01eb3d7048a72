#pragma once

#include <string>

#include "libs/bus/process.h"
#include "procs/frontend/frontend.h"

namespace mapmend {

// How images come: all of a file, one after the other (lockstep: the result does not depend on timing); a file at the
// pace of its times; a camera on the bus. In the last two, images that come while the frontend is busy are dropped.
enum class InputMode { kLockstep, kRealtime, kLive };

// The frontend's command line.
struct RunOptions {
  ProcessOptions process;
  std::string input, camera_path, times_path, vocabulary_path, skip_frames, session, outbox_path, vehicle;
  int num_features = 0;   // per image; 0: 1000 up to one megapixel, 2000 above
  int max_dimension = 0;  // pixels; larger images are scaled down; 0: never
  uint64_t seed = 1;
  std::string events_path;   // file that gets a JSON line for each loss, submap, end; empty: none
  // A second LCM network, on board: live images come over it, and health goes to it as well; empty: there is none. The
  // stream goes over process.lcm_url alone.
  std::string local_url;
  std::string profile_path;  // JSON file for the time of each stage; empty: none
  InputMode mode = InputMode::kLockstep;
  double speed = 1;     // kRealtime: times as fast as the images were taken
  int max_waiting = 3;  // kRealtime, kLive: images that may wait for the frontend
  // At the end of the flight: so long without progress it waits for a link or a silent store, seconds.
  int deliver_timeout_s = 300;
  FrontendOptions frontend;
};

// Every option as JSON, for the record in the session's first message.
std::string ToJson(const RunOptions& options);

// A session's name for a file: the same input, options and seed give the same UUID, so that a run can be repeated bit
// for bit.
std::string SessionForFile(const RunOptions& options);

// "lockstep", "realtime" or "live".
std::string ModeName(InputMode mode);

// Runs the frontend on its input until the end, or until a signal asks it to stop. Returns the process's exit code: 0,
// or 3 if the input turned out to be truncated (what could be read is mapped).
int RunFrontend(const RunOptions& options);

}  // namespace mapmend
