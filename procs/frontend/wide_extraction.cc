#include "procs/frontend/wide_extraction.h"

#include <algorithm>
#include <opencv2/core.hpp>

#include "libs/base/options.h"
#include "procs/frontend/give_way.h"
#include "procs/frontend/profiler.h"

namespace mapmend {

std::string WideFeaturesOptions::Check() const { return CheckOptions(*this); }

WideExtraction::~WideExtraction() {
  {
    const std::lock_guard lock(mutex_);
    stop_ = true;
  }
  changed_.notify_all();
  if (thread_.joinable()) thread_.join();
}

void WideExtraction::Request(SubmapId submap, KeyframeId keyframe, const Frame& frame, int64_t due) {
  {
    const std::lock_guard lock(mutex_);
    Job& job = jobs_.emplace_back();
    job.utime = frame.utime;
    job.due = due;
    job.record.submap = submap;
    job.record.keyframe = keyframe;
    job.record.frame = frame.index;
    job.image = frame.image;
  }
  if (!thread_.joinable()) thread_ = std::thread([this] { Run(); });
  changed_.notify_all();
}

void WideExtraction::Run() {
  GiveWayToTracking();
  std::unique_lock lock(mutex_);
  for (;;) {
    changed_.wait(lock, [this] { return stop_ || num_finished_ < jobs_.size(); });
    if (stop_) return;
    const std::shared_ptr<const cv::Mat> image = jobs_[num_finished_].image;
    lock.unlock();
    WideFeatures features;
    std::exception_ptr error;
    try {
      const StageTimer timer("wide/features");
      features = extract_(*image);
    } catch (...) {
      error = std::current_exception();
    }
    lock.lock();
    // Jobs are taken only once they are finished: this one is still where it was, counted from the first unfinished.
    Job& job = jobs_[num_finished_];
    job.record.features = std::move(features);
    job.image = nullptr;
    ++num_finished_;
    if (error) error_ = error;
    changed_.notify_all();
  }
}

WideExtraction::Records WideExtraction::Take(size_t count) {
  if (error_) std::rethrow_exception(error_);
  Records records;
  for (; records.size() < count; jobs_.pop_front(), --num_finished_)
    records.emplace_back(jobs_.front().utime, std::move(jobs_.front().record));
  return records;
}

WideExtraction::Records WideExtraction::TakeFinished() {
  const std::lock_guard lock(mutex_);
  return Take(num_finished_);
}

WideExtraction::Records WideExtraction::TakeDue(int64_t now) {
  std::unique_lock lock(mutex_);
  const auto count = static_cast<size_t>(
      std::find_if(jobs_.begin(), jobs_.end(), [&](const Job& job) { return job.due > now; }) - jobs_.begin());
  changed_.wait(lock, [&] { return num_finished_ >= count; });
  return Take(count);
}

}  // namespace mapmend
