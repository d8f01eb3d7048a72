#include "libs/merging/background_refinement.h"

#include <malloc.h>
#include <sys/resource.h>
#include <sys/syscall.h>
#include <unistd.h>

#include <utility>

namespace mapmend {

namespace {

struct GivenUp : std::exception {};

}  // namespace

BackgroundRefinement::~BackgroundRefinement() {
  give_up_ = true;
  if (thread_.joinable()) thread_.join();
}

void BackgroundRefinement::Start(RefinementTask task, Open open) {
  give_up_ = false;
  done_ = false;
  outcome_.reset();
  error_ = nullptr;
  thread_ = std::thread([this, task = std::move(task), open = std::move(open)] { Run(task, open); });
}

void BackgroundRefinement::Run(const RefinementTask& task, const Open& open) {
  // On Linux a priority set by thread id is that thread's alone, and the threads it starts inherit it.
  constexpr int kNice = 10;
  if (!task.is_final) setpriority(PRIO_PROCESS, static_cast<id_t>(syscall(SYS_gettid)), kNice);
  std::optional<RefinementOutcome> outcome;
  std::exception_ptr error;
  try {
    outcome = RunRefinement(
        task,
        [this](const std::string& what) {
          if (give_up_) throw GivenUp();
          const std::lock_guard<std::mutex> lock(mutex_);
          progress_.push_back(what);
        },
        [&] { return open([this] { return give_up_.load(); }); });
  } catch (...) {
    if (!give_up_) error = std::current_exception();
  }
  malloc_trim(0);  // it takes a multiple of what the merger itself needs
  const std::lock_guard<std::mutex> lock(mutex_);
  outcome_ = std::move(outcome);
  error_ = error;
  done_ = true;
}

std::optional<RefinementOutcome> BackgroundRefinement::Poll() {
  {
    const std::lock_guard<std::mutex> lock(mutex_);
    if (!done_ || !thread_.joinable()) return std::nullopt;
  }
  thread_.join();
  if (error_) std::rethrow_exception(error_);
  return std::move(outcome_);
}

std::vector<std::string> BackgroundRefinement::TakeProgress() {
  const std::lock_guard<std::mutex> lock(mutex_);
  return std::exchange(progress_, {});
}

}  // namespace mapmend
