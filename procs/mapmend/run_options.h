#pragma once

#include <optional>
#include <string>
#include <vector>

// What `mapmend run` was asked to do, and what the checks of its inputs found out.
namespace mapmend {

struct RunOptions {
  std::string input;        // a video file or a folder of images; empty with live
  std::string camera;       // empty: camera.yaml beside the input
  std::string times;        // empty: times.txt beside the input if there is one, else the video's own times
  std::string out;          // empty: ./mapmend-<name of the input>
  std::string vocabulary;   // empty: mapmend's own
  std::string groundtruth;  // empty: none
  std::string record;       // folder for a log of the stream; empty: none
  std::string skip_frames;  // e.g. 80-120,200-240
  std::string session;      // UUID; empty: made from input and options, new with append
  std::string vehicle;
  std::string lcm_url;  // empty: LCM_DEFAULT_URL, else a private hub on a free port
  std::string channel_prefix;
  std::string log_level = "info";
  std::optional<int> seed, features, max_dimension;  // unset: the processes' own defaults
  std::optional<int> lost_frames,
      relocalisation_frames;       // of the loss criterion (paper, 3.2); unset: the frontend's own
  std::optional<int> port;         // of the live page; unset: a free one from 8080 on; 0: no page
  bool overwrite = false;          // replace the results of an earlier run in out
  bool realtime = false;           // play the input at its own pace, drop what comes too fast
  bool live = false;               // images come over the bus
  std::optional<double> speed;     // with realtime; unset: 1
  std::optional<int> max_waiting;  // with realtime or live: frames that may wait; unset: the frontend's
  bool profile = false;            // time of each stage of the frontend, in the summary
  bool append = false;             // map this flight into the map that is already in out
};

struct RunInputs {
  RunOptions options;  // with every default filled in
  std::string vocabulary_hash;
  int num_frames = 0;              // of the input; 0 if the video does not say
  std::vector<std::string> notes;  // lines for the user, e.g. which camera file was taken
};

// Checks everything that can be checked before a process is started. Changes nothing on disk.
// Throws std::runtime_error with one line that names the file or option and says what to do.
RunInputs CheckRunInputs(const RunOptions& options);

}  // namespace mapmend
