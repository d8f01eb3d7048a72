#pragma once

#include <cstdint>
#include <fstream>
#include <string>
#include <vector>

namespace mapmend {

// One message in a recording.
struct LoggedEvent {
  int64_t offset = 0;  // of the event in the file
  int64_t utime = 0;   // of the recording
  std::string channel;
  std::vector<uint8_t> data;
};

// A recording of lcm-logger, read from its start, however damaged: behind what cannot be an event, reading goes on at
// the next one. (liblcm's own reader stops there, or crashes.) An event whose length is damaged may be given with bytes
// that are not its own: checksums and decoders see that.
class RecordingFile {
 public:
  // Throws std::runtime_error naming the file if it cannot be read or does not hold one event.
  explicit RecordingFile(const std::string& path);

  // The next event. False at the end.
  bool Next(LoggedEvent* event);
  // The event at an offset that Next gave. False if it is no longer there.
  bool ReadAt(int64_t offset, LoggedEvent* event);

  struct Damage {
    int64_t offset = 0, num_bytes = 0;
  };
  // What could not be read so far, but for a torn event at the end.
  const std::vector<Damage>& Damages() const { return damages_; }
  bool HasTornEnd() const { return has_torn_end_; }
  const std::string& Path() const { return path_; }

  // Whether a file begins as a recording does.
  static bool IsLog(const std::string& path);

 private:
  struct Header {
    bool has_sync = false, is_plausible = false;
    int64_t utime = 0, channel_size = 0, data_size = 0, end = 0;
  };
  Header ReadHeader(int64_t offset);
  bool IsBoundary(int64_t offset);  // an event begins there, or the file ends
  int64_t FindSync(int64_t offset);
  bool ReadBody(int64_t offset, const Header& header, LoggedEvent* event);
  void AddDamage(int64_t begin, int64_t end);

  std::string path_;
  std::ifstream file_;
  int64_t size_ = 0, next_ = 0;
  std::vector<Damage> damages_;
  bool has_torn_end_ = false;
};

// The logs that a person names: files as they are, of a folder all recordings in it (parts of lcm-logger --split or
// --rotate), in the order in which they were recorded. Throws std::runtime_error naming a folder without one.
std::vector<std::string> FindLogs(const std::vector<std::string>& paths);

}  // namespace mapmend
