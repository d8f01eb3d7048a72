#include "procs/merger/merger_process.h"

#include <spdlog/spdlog.h>
#include <unistd.h>

#include <mapmend/bow_query_t.hpp>
#include <mapmend/bow_result_t.hpp>
#include <optional>
#include <stdexcept>

#include "libs/bus/bus.h"
#include "libs/bus/channels.h"
#include "libs/bus/health.h"
#include "libs/bus/store_client.h"
#include "libs/bus/stream_consumer.h"
#include "libs/retrieval/vocabulary.h"
#include "procs/merger/merger_messages.h"

namespace mapmend {
namespace {

class StoreBowSource : public BowSource {
 public:
  explicit StoreBowSource(StoreClient* client) : client_(client) {}

  std::vector<BowProposal> Query(const BowQuestion& question) override {
    bow_query_t query{};
    query.session = question.session;
    query.keyframe = question.keyframe.value;
    for (const MergerCursor& c : question.cursors) {
      cursor_t cursor{};
      cursor.session = c.session;
      cursor.seq = c.seq;
      query.cursors.push_back(cursor);
    }
    query.num_cursors = static_cast<int32_t>(query.cursors.size());
    query.max_results = question.max_results;
    query.same_submap = question.same_submap ? 1 : 0;
    for (;;) {
      const std::optional<bow_result_t> result = client_->Query(query);
      if (result) {
        // Whatever the store cannot answer it cannot answer later either; skipping is the same on every run.
        if (result->status != bow_result_t::OK) {
          spdlog::warn("merger: the store cannot search for keyframe {} (status {})", query.keyframe, result->status);
          return {};
        }
        std::vector<BowProposal> proposals;
        for (const bow_candidate_t& c : result->candidates) {
          proposals.push_back({c.session, SubmapId(c.submap), KeyframeId(c.keyframe), c.group_score});
        }
        return proposals;
      }
      // Going on without an answer would make the map depend on the outage: wait for the store.
      if (StopRequested()) throw std::runtime_error("stopped while waiting for the store");
      spdlog::warn("merger: the store does not answer, trying again");
    }
  }

 private:
  StoreClient* client_;
};

class BusOutput : public MergerOutput {
 public:
  BusOutput(Bus* bus, StoreClient* client, HealthReporter* health) : bus_(bus), client_(client), health_(health) {}

  void OnConnection(const Connection& connection) override {
    bus_->Publish(channels::kConnection, ToMessage(connection));
    const char* verdict = connection.verdict == Connection::Verdict::kAccepted      ? "accepted"
                          : connection.verdict == Connection::Verdict::kDeactivated ? "deactivated"
                                                                                    : "rejected";
    spdlog::debug("merger: submaps {} and {} {}: {}", connection.a.submap.value, connection.b.submap.value, verdict,
                  connection.reason);
    health_->Tick();
  }
  void OnTransforms(const MergedTransforms& transforms) override {
    bus_->Publish(channels::kMergedTransforms, ToMessage(transforms));
    health_->SetCounter("revision", static_cast<double>(transforms.revision));
    health_->Tick();
  }
  void OnRevision(const MergedTransforms& transforms, const std::vector<Connection>& connections,
                  const std::vector<RefinedSubmap>& submaps) override {
    std::vector<revision_part_t> parts;
    for (const RefinedSubmap& s : submaps) {
      parts.push_back(ToMessage(s, transforms.revision, static_cast<int>(parts.size())));
    }
    const revision_t revision = ToMessage(transforms, connections, static_cast<int>(parts.size()));
    while (!client_->StoreRevision(revision, parts)) {
      if (StopRequested()) throw std::runtime_error("stopped before the store had taken the merged map");
      spdlog::warn("merger: the store does not take the merged map, trying again");
      health_->Tick();
    }
    OnTransforms(transforms);
  }
  void OnProgress(const std::string& what) override {
    if (what != progress_) spdlog::debug("merger: {}", what);
    progress_ = what;
    health_->Tick();
  }

 private:
  Bus* bus_;
  StoreClient* client_;
  HealthReporter* health_;
  std::string progress_;
};

}  // namespace

int RunMergerProcess(const MergerProcessOptions& options) {
  MergerOptions merger_options;
  merger_options.connected_frames.ransac.seed = options.seed;
  if (const std::string error = merger_options.Check(); !error.empty()) throw std::runtime_error(error);
  std::string vocabulary_hash;
  if (!options.vocabulary.empty()) vocabulary_hash = Vocabulary::Read(options.vocabulary).Hash();

  InstallSignalHandlers();
  Bus bus(ResolveLcmUrl(options.process.lcm_url), options.process.channel_prefix);
  HealthReporter health(&bus, "merger");
  StoreClient client(&bus, "merger-" + std::to_string(getpid()));
  StoreBowSource bow(&client);
  BusOutput output(&bus, &client, &health);
  Merger merger(merger_options, &bow, &output);
  int64_t num_refused = 0;
  bool work_left = false;
  StreamConsumer consumer(&bus, &client, [&](const Record& record) {
    if (const auto* start = std::get_if<SessionStarted>(&record.body)) {
      if (!vocabulary_hash.empty() && !start->vocabulary_hash.empty() && start->vocabulary_hash != vocabulary_hash) {
        throw std::runtime_error("session " + record.header.session + " was made with another vocabulary (" +
                                 start->vocabulary_hash + ") than " + options.vocabulary + " (" + vocabulary_hash + ")");
      }
    }
    const std::string error = merger.Consume(record);
    if (!error.empty()) {
      ++num_refused;
      spdlog::warn("merger: record {} of session {} refused: {}", record.header.seq, record.header.session, error);
      return;
    }
    work_left = true;
    health.SetCursor(record.header.session, record.header.seq);
  });

  health.SetState("ready");
  while (!StopRequested()) {
    const int delivered = consumer.Spin(50);
    health.SetQueueDepth(consumer.QueueDepth());
    health.SetCounter("connections", merger.num_connections());
    health.SetCounter("edges_accepted", merger.num_accepted());
    health.SetCounter("components", merger.num_components());
    health.SetCounter("refused", static_cast<double>(num_refused + consumer.NumRefused()));
    if (work_left && delivered > 0) health.SetState("busy");
    if (work_left && delivered == 0 && consumer.QueueDepth() == 0 && merger.AllEnded()) {
      health.SetState("busy", "refining the merged map");
      merger.Finalize();
      work_left = false;
      health.SetCounter("connections", merger.num_connections());
      health.SetCounter("edges_accepted", merger.num_accepted());
      health.SetCounter("components", merger.num_components());
      health.SetState("done");
    }
    health.Tick();
  }
  return 0;
}

}  // namespace mapmend
