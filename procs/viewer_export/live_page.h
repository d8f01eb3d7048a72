#pragma once

#include <chrono>
#include <functional>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "libs/map_view/image_source.h"
#include "libs/map_view/map_model.h"
#include "libs/map_view/world.h"
#include "procs/viewer_export/coverage.h"
#include "procs/viewer_export/live_questions.h"
#include "procs/viewer_export/live_state.h"

namespace mapmend {

// The live page, and what it may do.
struct PageOptions {
  std::string bind = "127.0.0.1";
  int port = 0;            // 0: none
  std::string files;       // folder of results; empty: none
  std::string token;       // who acts on the map must show it; empty: nobody may
  bool is_stored = false;  // a finished map is shown: nothing more is expected
};

// The page as the viewer feeds it: what is told here is on every page that is open within a second. Knows nothing of
// LCM.
class LivePage {
 public:
  // Listens at once. Throws std::runtime_error with one line if the port cannot be had.
  LivePage(const PageOptions& options, const PlacementOptions& placement, const CoverageOptions& coverage);
  ~LivePage();
  LivePage(const LivePage&) = delete;
  LivePage& operator=(const LivePage&) = delete;

  void OnFramePose(const FramePose& pose) { inputs_.OnFramePose(pose); }
  void OnHealth(const Health& health) { inputs_.OnHealth(health); }
  // After the model has taken it.
  void OnRecord(const Record& record, const MapModel& model);
  void OnRevision(const MapModel& model);
  void SetDecisions(const std::vector<EdgeDecision>& decisions) { decisions_ = decisions; }

  // Brings the feed up to date, not too often. exported: the exports of this very map have been written. is_deaf: in
  // the middle of long work, and the bus was not listened to since the last time.
  void Update(const MapModel& model, bool exported, bool is_deaf = false);

  // Tells the pages that the viewer ends; exported as for Update.
  void Stop(const MapModel& model, bool exported);

  // Answers one question of a page.
  //   decide  makes a decision; all decisions, or nothing if the store does not answer
  using Decide = std::function<std::optional<std::vector<EdgeDecision>>(const EdgeDecision&)>;
  void AnswerOne(const MapModel& model, const PictureSource& pictures, const Decide& decide);

  // The stacks L1 and L2, worked out now and then.
  const std::string& Stacks() const;
  std::string Url() const;

 private:
  LiveQuestions::Answer Answer(const LiveQuestions::Question& question, const MapModel& model,
                               const PictureSource& pictures, const Decide& decide);

  struct Impl;
  std::unique_ptr<Impl> impl_;
  LiveInputs inputs_;
  std::chrono::steady_clock::time_point last_update_;
  std::vector<EdgeDecision> decisions_;
};

}  // namespace mapmend
