#pragma once

#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "libs/bus/bus.h"
#include "libs/stream/keyframe_images.h"
#include "libs/stream/revision.h"
#include "libs/stream/store_questions.h"

namespace mapmend {

// Requests to the store by id, with time-out and retry (requests.h). Synchronous: each call runs the bus's Handle until
// the reply is there (so other handlers of the bus run meanwhile and must not call back into the client). Whoever calls
// again with the same arguments after a time-out goes on waiting for the same answer.
class StoreClient {
 public:
  StoreClient(Bus* bus, const std::string& requester);  // requester: unique on the bus, e.g. "merger-<pid>"
  ~StoreClient();

  // id and requester are filled in. The answer "not yet" is asked again until timeout_ms. nullopt: no answer in time.
  std::optional<BowAnswer> Query(const BowQuestion& question, int timeout_ms = 10000);
  std::optional<FetchAnswer> Fetch(FetchRequest request, int timeout_ms = 10000);
  // Sends a revision, head and parts, until each is acknowledged. False if not in time.
  bool StoreRevision(const MapRevision& revision, int timeout_ms = 30000);
  // Reads a stored revision with all its parts. number -1: the newest whose parts are all stored.
  enum class RevisionStatus { kOk, kNone, kNoAnswer };
  struct FetchedRevision {
    RevisionStatus status = RevisionStatus::kNoAnswer;
    int64_t number = -1;   // of the revision that there is
    MapRevision revision;  // if the status is kOk
    std::string error;     // one line, if what is stored cannot be
  };
  FetchedRevision FetchRevision(int64_t number, int timeout_ms = 10000);
  // Adds decisions about connections to those that the store holds; returns all of them, in order. nullopt: no answer
  // in time.
  std::optional<std::vector<EdgeDecision>> DecideEdges(const std::vector<EdgeDecision>& decisions,
                                                       int timeout_ms = 10000);
  // How far a session has come. nullopt: no answer in time.
  std::optional<SessionProgress> AskProgress(const std::string& session, int timeout_ms = 10000);
  // Ends a session whose frontend died. nullopt: no answer in time.
  std::optional<CloseAnswer> CloseSession(const std::string& session, int timeout_ms = 10000);
  // The image of a keyframe, or the answer that there is none. nullopt: no answer in time.
  std::optional<ImageAnswer> FetchImage(const std::string& session, KeyframeId keyframe, int timeout_ms = 10000);
  // How many keyframes of a session (empty: of all) have their images. nullopt: no answer in time.
  std::optional<ImageStatus> AskImages(const std::string& session, int timeout_ms = 10000);

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

}  // namespace mapmend
