#include "procs/merger/merger_process.h"

#include <spdlog/spdlog.h>
#include <time.h>
#include <unistd.h>

#include <algorithm>
#include <functional>
#include <memory>
#include <optional>
#include <stdexcept>
#include <utility>

#include "libs/bus/bus.h"
#include "libs/bus/channels.h"
#include "libs/bus/health.h"
#include "libs/merging/background_refinement.h"
#include "libs/retrieval/vocabulary.h"
#include "libs/stream/tree_changes.h"
#include "libs/wire/codec.h"
#include "libs/wire/query_codec.h"
#include "libs/wire/revision_codec.h"
#include "libs/wire/store_client.h"
#include "libs/wire/stream_consumer.h"
#include "procs/merger/latency_meter.h"

namespace mapmend {
namespace {

class StoreBowSource : public BowSource {
 public:
  explicit StoreBowSource(StoreClient* client) : client_(client) {}

  std::vector<BowProposal> Query(const BowQuestion& question) override {
    for (;;) {
      std::optional<BowAnswer> answer = client_->Query(question);
      if (answer) {
        // Whatever the store cannot answer it cannot answer later either; skipping is the same on every run.
        if (answer->status != BowAnswer::Status::kOk) {
          spdlog::warn("merger: the store cannot search for keyframe {} (status {})", question.keyframe.value,
                       static_cast<int>(answer->status));
          return {};
        }
        return std::move(answer->proposals);
      }
      // Going on without an answer would make the map depend on the outage: wait for the store.
      if (StopRequested()) throw std::runtime_error("stopped while waiting for the store");
      spdlog::warn("merger: the store does not answer, trying again");
    }
  }

 private:
  StoreClient* client_;
};

class StoreKeyframeSource : public KeyframeSource {
 public:
  StoreKeyframeSource(StoreClient* client, std::function<bool()> give_up)
      : client_(client), give_up_(std::move(give_up)) {}

  KeyframeRecord Read(const std::string& session, int64_t seq) override {
    return ReadAs<KeyframeRecord>(session, seq, "keyframe");
  }
  WideFeaturesRecord ReadWide(const std::string& session, int64_t seq) override {
    return ReadAs<WideFeaturesRecord>(session, seq, "wide features");
  }

 private:
  template <typename Body>
  Body ReadAs(const std::string& session, int64_t seq, const char* what) {
    const FetchRequest request{Addressed(), session, seq, seq, 1};  // at least one record is sent
    while (!give_up_()) {
      constexpr int kTimeoutMs = 2000;
      const std::optional<FetchAnswer> reply = client_->Fetch(request, kTimeoutMs);
      const bool is_ok = reply && reply->status == FetchAnswer::Status::kOk;
      if (is_ok && reply->records.size() == 1 && reply->records[0].seq == seq) {
        DecodedRecord decoded = DecodeRecord(reply->records[0]);
        if (auto* body = decoded.record ? std::get_if<Body>(&decoded.record->body) : nullptr) return std::move(*body);
        throw std::runtime_error(std::string("the store has no ") + what + " under record " + std::to_string(seq) +
                                 " of session " + session);
      }
      if (is_ok)
        throw std::runtime_error("the store no longer has record " + std::to_string(seq) + " of session " + session);
      spdlog::warn("merger: the store does not answer, trying again");
    }
    throw std::runtime_error("stopped while waiting for the store");
  }

  StoreClient* client_;
  const std::function<bool()> give_up_;
};

// For another thread: with a connection of its own.
class ConnectedKeyframeSource : public KeyframeSource {
 public:
  ConnectedKeyframeSource(const MergerProcessOptions& options, std::function<bool()> give_up)
      : bus_(ResolveLcmUrl(options.process.lcm_url), options.process.channel_prefix),
        client_(&bus_, "refinement-" + std::to_string(getpid())),
        source_(&client_, std::move(give_up)) {}

  KeyframeRecord Read(const std::string& session, int64_t seq) override { return source_.Read(session, seq); }
  WideFeaturesRecord ReadWide(const std::string& session, int64_t seq) override {
    return source_.ReadWide(session, seq);
  }

 private:
  Bus bus_;
  StoreClient client_;
  StoreKeyframeSource source_;
};

std::vector<EvaluatedConnection> AnnouncedAll(const std::vector<Connection>& connections) {
  std::vector<EvaluatedConnection> announced;
  for (const Connection& connection : connections) announced.push_back(Announced(connection));
  return announced;
}

class BusOutput : public MergerOutput {
 public:
  BusOutput(Bus* bus, StoreClient* client, HealthReporter* health, LatencyMeter* latency)
      : bus_(bus), client_(client), health_(health), latency_(latency) {}

  void OnConnection(const Connection& connection) override {
    bus_->Publish(channels::kConnection, Announced(connection));
    spdlog::debug("merger: submaps {} and {} {}: {}", connection.a.submap.value, connection.b.submap.value,
                  ToString(connection.verdict), connection.reason);
    health_->Tick();
  }
  void OnTransforms(const MergedTransforms& transforms) override {
    bus_->Publish(channels::kMergedTransforms, transforms);
    for (const TreeChange& change : tree_.Update(transforms)) {
      spdlog::info("merger: {} {}, revision {}", DescribePair(change), change.joined ? "joined" : "not joined any more",
                   transforms.revision);
    }
    if (!transforms.refined) latency_->OnBroadcast();
    health_->SetCounter("revision", static_cast<double>(transforms.revision));
    health_->Tick();
  }
  void OnRevision(const MergedTransforms& transforms, const std::vector<Connection>& connections,
                  const std::vector<RefinedSubmap>& submaps) override {
    const MapRevision revision{transforms, AnnouncedAll(connections), submaps};
    while (!client_->StoreRevision(revision)) {
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
  LatencyMeter* latency_;
  TreeChanges tree_;
  std::string progress_;
};

double ThreadCpuMs() {
  timespec t{};
  clock_gettime(CLOCK_THREAD_CPUTIME_ID, &t);
  return 1e3 * static_cast<double>(t.tv_sec) + 1e-6 * static_cast<double>(t.tv_nsec);
}

// The loop of the process: records and decisions in, revisions out, refinement beside it.
class MergerLoop {
 public:
  MergerLoop(const MergerProcessOptions& options, const MergerOptions& merger_options,
             const std::string& vocabulary_hash, Bus* bus)
      : options_(options),
        vocabulary_hash_(vocabulary_hash),
        bus_(bus),
        health_(bus, "merger"),
        client_(bus, "merger-" + std::to_string(getpid())),
        bow_(&client_),
        keyframes_(&client_, StopRequested),
        output_(bus, &client_, &health_, &latency_),
        merger_(merger_options, &bow_, &output_, &keyframes_),
        consumer_(bus, &client_, [this](const Record& record) { OnRecord(record); }) {
    subscriptions_.push_back(
        bus->Subscribe<EdgeAnswer>(channels::kEdgeDecisions, Delivery::kKeepAll,
                                   [this](const EdgeAnswer& answer) { OnDecisions(answer.decisions); }));
    subscriptions_.push_back(
        bus->SubscribeRaw(channels::kKeyframe, Delivery::kKeepAll, [this](const uint8_t* data, int size) {
          if (const auto header = PeekHeader(data, size)) latency_.OnHeard(header->session, header->seq);
        }));
    subscriptions_.push_back(bus->Subscribe<GraphRequest>(
        channels::kGraphRequest, Delivery::kKeepAll, [this](const GraphRequest& request) { OnGraphRequest(request); }));
  }

  void Run() {
    health_.SetState("ready");
    while (!StopRequested()) {
      const int delivered = AskForDecisions() ? consumer_.Spin(refinement_.IsRunning() ? 10 : 50) : 0;
      Heed();
      const bool is_idle = delivered == 0 && consumer_.QueueDepth() == 0;
      if (is_idle && merger_.AllEnded() && completed_at_ != NumDelivered()) Complete();
      Refine();
      Answer();
      Report();
    }
  }

 private:
  void OnRecord(const Record& record) {
    if (const auto* start = std::get_if<SessionStarted>(&record.body)) {
      if (!vocabulary_hash_.empty() && !start->vocabulary_hash.empty() && start->vocabulary_hash != vocabulary_hash_) {
        throw std::runtime_error("session " + record.header.session + " was made with another vocabulary (" +
                                 start->vocabulary_hash + ") than " + options_.vocabulary + " (" + vocabulary_hash_ +
                                 ")");
      }
    }
    const bool is_keyframe = std::holds_alternative<KeyframeRecord>(record.body);
    if (is_keyframe) latency_.OnDelivered(record.header.session, record.header.seq);
    const double begin_ms = ThreadCpuMs();
    const std::string error = merger_.Consume(record);
    ++num_consumed_;
    // The update behind a keyframe is where it is evaluated.
    if (is_keyframe) {
      keyframe_ms_ = ThreadCpuMs() - begin_ms;
    } else if (keyframe_ms_ && std::holds_alternative<MapUpdate>(record.body)) {
      evaluation_ms_.push_back(*keyframe_ms_ + ThreadCpuMs() - begin_ms);
      keyframe_ms_.reset();
    }
    if (!error.empty()) {
      ++num_refused_;
      spdlog::warn("merger: record {} of session {} refused: {}", record.header.seq, record.header.session, error);
      return;
    }
    health_.SetCursor(record.header.session, record.header.seq);
    health_.SetState("busy");
  }

  // In handlers only noted: they may run in the middle of an evaluation that waits for the store.
  void OnDecisions(const std::vector<EdgeDecision>& decisions) {
    // Decisions are only ever added: fewer are an answer that came late.
    if (decisions.size() >= decisions_.size()) decisions_ = decisions;
  }

  // One that is repeated while it waits is answered once.
  void OnGraphRequest(const GraphRequest& request) {
    for (const GraphRequest& waiting : requests_) {
      if (waiting.requester == request.requester && waiting.id == request.id) return;
    }
    requests_.push_back(request);
  }

  // Once, before anything else: what was decided earlier holds for all that follows.
  bool AskForDecisions() {
    if (!knows_decisions_) {
      constexpr int kTimeoutMs = 400;
      knows_decisions_ = client_.DecideEdges({}, kTimeoutMs).has_value();
    }
    return knows_decisions_;
  }

  void Heed() {
    const int known = merger_.graph().num_decisions();
    merger_.SetDecisions(decisions_);
    if (merger_.graph().num_decisions() != known) refinement_.Abandon();
  }

  int64_t NumDelivered() const { return num_consumed_; }

  void Complete() {
    health_.SetState("busy", "comparing all submaps");
    refinement_.Abandon();     // what it would say is superseded
    knows_decisions_ = false;  // a message may have been missed
    while (!AskForDecisions() && !StopRequested()) health_.Tick();
    Heed();
    spdlog::info(
        "merger: {} broadcasts {:.0f} ms (median), {:.0f} ms (p95) after their keyframe; {:.1f} ms of CPU a keyframe "
        "(median of {})",
        latency_.Count(), latency_.Percentile(0.5), latency_.Percentile(0.95), MedianEvaluationMs(),
        evaluation_ms_.size());
    merger_.Complete();
    completed_at_ = NumDelivered();
  }

  void Refine() {
    if (refinement_.IsRunning()) {
      const std::optional<RefinementOutcome> outcome = refinement_.Poll();
      for (const std::string& what : refinement_.TakeProgress()) {
        spdlog::info("merger: {}", what);
        output_.OnProgress(what);
      }
      if (outcome && merger_.TakeRefinement(*outcome)) {
        spdlog::info("merger: revision {} refined{}", merger_.revision(), merger_.IsFinal() ? ", final" : "");
        for (const auto& [session, shutter] : merger_.shutters()) {
          spdlog::info("merger: session {}: images are read {}, in {:.1f} ms; corrected", session,
                       shutter.lines == ScanLines::kRows ? "row by row" : "column by column", 1e3 * shutter.readout);
        }
      }
    }
    // During the flight only when there is nothing to catch up with.
    constexpr int kMaxBehind = 8;
    if (!refinement_.IsRunning() && merger_.RefinementIsDue() && consumer_.QueueDepth() <= kMaxBehind) {
      if (completed_at_ == NumDelivered()) health_.SetState("busy", "refining the merged map");
      refinement_.Start(merger_.MakeRefinement(), [this](const std::function<bool()>& give_up) {
        return std::make_unique<ConnectedKeyframeSource>(options_, give_up);
      });
    }
  }

  void Answer() {
    for (const GraphRequest& request : std::exchange(requests_, {})) {
      bus_->Publish(channels::kGraph, GraphReply{request, merger_.transforms(), merger_.graph().num_decisions(),
                                                 AnnouncedAll(merger_.connections())});
    }
  }

  // How long things took, now and then.
  void ReportTimes() {
    const auto now = LatencyMeter::Clock::now();
    if (now - times_reported_ < std::chrono::seconds(1)) return;
    times_reported_ = now;
    if (latency_.Count() > 0) {
      health_.SetCounter("broadcast_ms_median", latency_.Percentile(0.5));
      health_.SetCounter("broadcast_ms_p95", latency_.Percentile(0.95));
    }
    if (!evaluation_ms_.empty()) health_.SetCounter("keyframe_cpu_ms_median", MedianEvaluationMs());
  }

  double MedianEvaluationMs() const {
    if (evaluation_ms_.empty()) return 0;
    std::vector<double> ms = evaluation_ms_;
    std::nth_element(ms.begin(), ms.begin() + static_cast<long>(ms.size() / 2), ms.end());
    return ms[ms.size() / 2];
  }

  void Report() {
    ReportTimes();
    health_.SetQueueDepth(consumer_.QueueDepth());
    health_.SetCounter("connections", static_cast<double>(merger_.graph().connections().size()));
    health_.SetCounter("edges_accepted", merger_.graph().num_accepted());
    health_.SetCounter("components", merger_.graph().forest().num_components);
    health_.SetCounter("keyframes_cached", merger_.keyframe_cache().num_loaded());
    health_.SetCounter("keyframes_read", static_cast<double>(merger_.keyframe_cache().num_reads()));
    health_.SetCounter("refused", static_cast<double>(num_refused_ + consumer_.NumRefused()));
    if (!merger_.shutters().empty()) {
      const Shutter& shutter = merger_.shutters().begin()->second;
      health_.SetCounter("readout_ms", 1e3 * shutter.readout);
      health_.SetCounter("readout_by_columns", shutter.lines == ScanLines::kColumns ? 1 : 0);
    }
    if (completed_at_ == NumDelivered() && merger_.IsFinal() && !merger_.RefinementIsDue()) health_.SetState("done");
    health_.Tick();
  }

  const MergerProcessOptions& options_;
  const std::string vocabulary_hash_;
  Bus* bus_;
  HealthReporter health_;
  StoreClient client_;
  StoreBowSource bow_;
  StoreKeyframeSource keyframes_;
  LatencyMeter latency_;
  BusOutput output_;
  Merger merger_;
  StreamConsumer consumer_;
  BackgroundRefinement refinement_;
  std::vector<EdgeDecision> decisions_;
  std::vector<GraphRequest> requests_;
  std::optional<double> keyframe_ms_;  // CPU time of this thread
  std::vector<double> evaluation_ms_;
  LatencyMeter::Clock::time_point times_reported_;
  bool knows_decisions_ = false;
  int64_t num_consumed_ = 0, num_refused_ = 0;
  int64_t completed_at_ = 0;  // number of records at the last second pass
  std::vector<Subscription> subscriptions_;
};

}  // namespace

int RunMergerProcess(const MergerProcessOptions& options) {
  std::string vocabulary_hash;
  if (!options.vocabulary.empty()) vocabulary_hash = Vocabulary::Read(options.vocabulary).Hash();
  InstallSignalHandlers();
  Bus bus(ResolveLcmUrl(options.process.lcm_url), options.process.channel_prefix);
  MergerLoop(options, options.merger, vocabulary_hash, &bus).Run();
  return 0;
}

}  // namespace mapmend
