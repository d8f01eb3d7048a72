#pragma once

#include <atomic>
#include <exception>
#include <functional>
#include <memory>
#include <mutex>
#include <optional>
#include <string>
#include <thread>
#include <vector>

#include "libs/merging/refinement_task.h"

namespace mapmend {

// Runs one refinement at a time in a thread of its own, at low priority: tracking and connecting go first.
class BackgroundRefinement {
 public:
  BackgroundRefinement() = default;
  ~BackgroundRefinement();  // gives up what runs, at its next stage
  BackgroundRefinement(const BackgroundRefinement&) = delete;
  BackgroundRefinement& operator=(const BackgroundRefinement&) = delete;

  bool IsRunning() const { return thread_.joinable(); }
  // Opens a connection to where keyframes are read from. Called in the thread of the refinement; reading gives up by an
  // exception when give_up says so.
  using Open = std::function<std::unique_ptr<KeyframeSource>(const std::function<bool()>& give_up)>;
  // Must not be running.
  void Start(RefinementTask task, Open open);
  // The result, once. nullopt: not there yet, or abandoned. Throws what the refinement threw.
  std::optional<RefinementOutcome> Poll();
  // Gives up what runs, at its next stage: Poll will have no result of it, and IsRunning ends with a later Poll.
  void Abandon() { give_up_ = true; }
  // What it has said of its progress since the last call.
  std::vector<std::string> TakeProgress();

 private:
  void Run(const RefinementTask& task, const Open& open);

  std::thread thread_;
  std::atomic<bool> give_up_ = false;
  std::mutex mutex_;  // guards what follows
  bool done_ = false;
  std::optional<RefinementOutcome> outcome_;
  std::exception_ptr error_;
  std::vector<std::string> progress_;
};

}  // namespace mapmend
