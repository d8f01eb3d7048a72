#pragma once

#include <condition_variable>
#include <mutex>
#include <optional>
#include <set>
#include <string>

#include "libs/capture/live_stream.h"
#include "libs/capture/problems.h"
#include "libs/capture/steady_range.h"

namespace mapmend {

// A folder into which a camera writes its images one after the other: those that are there, then each that comes, in
// natural order of their names, without end. Nothing is dropped: what waits lies in the folder. A file is taken once it
// is whole; one that stays damaged for a while is left out. Times are those of the files' last change.
class FollowFolder : public LiveStream {
 public:
  // width, height: pixels; images of another size are left out. Throws std::runtime_error if there is no such folder.
  FollowFolder(const std::string& folder, int width, int height);

  std::optional<SourceImage> Next() override;
  void Stop() override;
  int64_t NumBad() const override { return problems_.Count(); }
  std::string LastProblem() const override { return problems_.Last(); }
  std::string News() const override { return problems_.News(); }
  int64_t NumNews() const override { return problems_.NumNews(); }
  std::string Name() const override { return "folder " + folder_; }

 private:
  // The next file; empty if there is none yet.
  std::string FindNext();
  bool WaitAWhile();  // false after Stop
  std::optional<SourceImage> Take(const std::string& path, bool may_still_grow, bool* is_done);

  const std::string folder_;
  const int width_, height_;
  std::set<std::string> seen_;
  std::string last_;
  int next_index_ = 0;
  int64_t last_utime_ = 0;
  SteadyRange range_;
  Problems problems_;
  std::mutex mutex_;
  std::condition_variable changed_;
  bool stop_ = false;
};

}  // namespace mapmend
