#include "libs/capture/follow_folder.h"

#include <sys/stat.h>

#include <algorithm>
#include <chrono>
#include <filesystem>
#include <opencv2/core.hpp>
#include <stdexcept>
#include <vector>

#include "libs/capture/decode_image.h"
#include "libs/capture/image_list.h"

namespace mapmend {
namespace {

namespace fs = std::filesystem;
using Clock = std::chrono::steady_clock;
using std::chrono::milliseconds;

constexpr milliseconds kPoll(100);       // a camera on a disk of another host gives no other sign
constexpr milliseconds kPatience(2000);  // for a file that is not whole yet

int64_t UtimeOf(const std::string& path) {
  struct stat status {};
  if (stat(path.c_str(), &status) != 0) return 0;
  return static_cast<int64_t>(status.st_mtim.tv_sec) * 1000000 + status.st_mtim.tv_nsec / 1000;
}

}  // namespace

FollowFolder::FollowFolder(const std::string& folder, int width, int height)
    : folder_(folder), width_(width), height_(height) {
  std::error_code error;
  if (!fs::is_directory(folder, error)) throw std::runtime_error("source " + folder + ": no such folder");
}

std::string FollowFolder::FindNext() {
  std::string next;
  std::error_code error;
  for (fs::directory_iterator entry(folder_, error); !error && entry != fs::directory_iterator();
       entry.increment(error)) {
    const std::string path = entry->path().string();
    std::error_code ignored;
    if (!HasImageName(path) || entry->path().filename().string().starts_with('.') || seen_.contains(path) ||
        !entry->is_regular_file(ignored))
      continue;
    if (!last_.empty() && NaturalLess(path, last_)) {
      seen_.insert(path);
      problems_.Add(path + " came after " + last_ + ", which follows it by name");
      continue;
    }
    if (next.empty() || NaturalLess(path, next)) next = path;
  }
  return next;
}

bool FollowFolder::WaitAWhile() {
  std::unique_lock lock(mutex_);
  return !changed_.wait_for(lock, kPoll, [this] { return stop_; });
}

std::optional<SourceImage> FollowFolder::Take(const std::string& path, bool may_still_grow, bool* is_done) {
  const DecodedImage image = ReadImageFile(path);
  *is_done = image.pixels || !may_still_grow;
  if (!*is_done) return std::nullopt;
  seen_.insert(path);
  last_ = path;
  const int index = next_index_++;
  if (!image.pixels) {
    problems_.Add(path + " " + image.problem);
    return std::nullopt;
  }
  if (image.pixels->cols != width_ || image.pixels->rows != height_) {
    problems_.Add(path + " has " + std::to_string(image.pixels->cols) + " x " + std::to_string(image.pixels->rows) +
                  " pixels, the camera file says " + std::to_string(width_) + " x " + std::to_string(height_));
    return std::nullopt;
  }
  last_utime_ = std::max(UtimeOf(path), last_utime_ + 1000);  // copied in a burst: a millisecond apart
  return SourceImage{index, last_utime_, std::make_shared<cv::Mat>(range_.To8Bit(*image.pixels)), image.jpeg};
}

std::optional<SourceImage> FollowFolder::Next() {
  std::string waiting_for;
  Clock::time_point since;
  while (true) {
    {
      const std::lock_guard lock(mutex_);
      if (stop_) return std::nullopt;
    }
    const std::string path = FindNext();
    if (!path.empty()) {
      if (path != waiting_for) {
        waiting_for = path;
        since = Clock::now();
      }
      bool is_done = false;
      if (auto image = Take(path, Clock::now() - since < kPatience, &is_done)) return image;
      if (is_done) continue;
    }
    if (!WaitAWhile()) return std::nullopt;
  }
}

void FollowFolder::Stop() {
  const std::lock_guard lock(mutex_);
  stop_ = true;
  changed_.notify_all();
}

}  // namespace mapmend
