#include "libs/merging/merger.h"

#include <algorithm>
#include <memory>
#include <utility>
#include <variant>

#include "libs/base/options.h"
#include "libs/merging/flight_seed.h"

namespace mapmend {
namespace {

bool SamePlaces(const MergedTransforms& l, const MergedTransforms& r) {
  if (l.submaps.size() != r.submaps.size() || l.edges != r.edges) return false;
  for (size_t i = 0; i < l.submaps.size(); ++i) {
    if (l.submaps[i].key != r.submaps[i].key || l.submaps[i].component != r.submaps[i].component ||
        ToArray(l.submaps[i].root_from_submap) != ToArray(r.submaps[i].root_from_submap)) {
      return false;
    }
  }
  return true;
}

}  // namespace

std::string MergerOptions::Check() const { return CheckOptions(*this); }

Merger::Merger(const MergerOptions& options, BowSource* bow, MergerOutput* output, KeyframeSource* keyframes)
    : options_(options),
      output_(output),
      search_(options.search, &sessions_, bow, keyframes, [output] { output->OnProgress("looking for connections"); }),
      wide_search_(options.wide, &sessions_, keyframes,
                   [output] { output->OnProgress("bridging gaps by wide features"); }),
      graph_(options.graph),
      refinement_(options.refinement) {}

bool Merger::AllEnded() const {
  return !sessions_.empty() &&
         std::all_of(sessions_.begin(), sessions_.end(), [](const auto& s) { return s.second.ended; });
}

std::string Merger::Consume(const Record& record) {
  const std::string& id = record.header.session;
  if (record.header.seq != 0 && !sessions_.contains(id)) return "session " + id + " has not started";
  Session& session = sessions_[id];
  const std::string error = session.Apply(record);
  if (!error.empty()) {
    if (session.last_seq < 0) sessions_.erase(id);
    return error;
  }
  ++num_records_;
  if (std::holds_alternative<SessionStarted>(record.body)) {
    search_.SetSeed(options_.seed.value_or(SeedOfFlights(sessions_).value_or(1)));
    wide_search_.SetSeed(search_.seed());
  }
  complete_ = false;
  if (const auto* keyframe = std::get_if<KeyframeRecord>(&record.body)) {
    search_.OnKeyframe({id, keyframe->submap}, keyframe->keyframe);
  } else if (std::holds_alternative<MapUpdate>(record.body)) {
    const std::optional<std::set<SubmapPair>> looked_at = search_.OnMapUpdate(id, &graph_);  // steps 4 and 5
    if (looked_at) {
      Announce(*looked_at, false);  // step 6
      search_.AskAgain(&graph_);
    }
  } else if (const auto* wide = std::get_if<WideFeaturesRecord>(&record.body)) {
    // Half a megabyte each, and seldom needed: they are read again.
    if (keyframes() != nullptr) session.submaps.at(wide->submap).ForgetWide(*wide);
  } else if (const auto* end = std::get_if<SubmapEnded>(&record.body)) {
    const std::set<SubmapPair> looked_at = search_.OnSubmapEnd({id, end->submap}, &graph_);
    session.submaps.at(end->submap).ForgetObservations();
    // The submap will not change any more: its connections are estimated from where its points have come to lie.
    graph_.Reestimate({id, end->submap});
    Announce(looked_at, false);
  }
  return "";
}

void Merger::Announce(const std::set<SubmapPair>& looked_at, bool all) {
  const std::vector<const Connection*> news = graph_.Solve(sessions_, looked_at, all);
  refinement_.OnGraphChange(graph_);
  for (const Connection* connection : news) output_->OnConnection(*connection);
  if (all) {
    for (const auto& [key, loops] : graph_.loops()) output_->OnConnection(loops);
  }
  MergedTransforms places = Places();
  if (!all && SamePlaces(places, transforms_)) return;
  transforms_ = std::move(places);
  output_->OnTransforms(transforms_);
}

MergedTransforms Merger::Places() const {
  MergedTransforms places =
      PlaceSubmaps(sessions_, graph_, complete_ ? std::map<SubmapKey, RefinedPlace>() : refinement_.places());
  places.revision = Number();
  return places;
}

void Merger::SetDecisions(const std::vector<EdgeDecision>& decisions) {
  if (static_cast<int>(decisions.size()) == graph_.num_decisions()) return;
  graph_.SetDecisions(decisions);
  if (!sessions_.empty()) Announce({}, true);
}

void Merger::Complete() {
  ConnectionGraph graph = graph_.WithoutConnections();
  std::set<SubmapPair> looked_at = search_.SearchAll(&graph);
  looked_at.merge(wide_search_.Bridge(&graph));
  looked_at.merge(BridgeByMotion(sessions_, options_.motion, &graph));
  graph_ = std::move(graph);
  refinement_.Forget();
  complete_ = true;
  Announce(looked_at, true);
}

bool Merger::RefinementIsDue() const {
  if (complete_) return !transforms_.is_final || transforms_.revision < Number() + 1;
  return !sessions_.empty() && !AllEnded() && refinement_.IsDue(sessions_, graph_);
}

RefinementTask Merger::MakeRefinement() {
  RefinementTask task = refinement_.Begin(sessions_, graph_, Places(), complete_, keyframes() == nullptr);
  task.state = Number();
  task.is_final = complete_ && AllEnded();
  return task;
}

bool Merger::TakeRefinement(const RefinementOutcome& outcome) {
  const int64_t number = Number() + 1;
  MergedTransforms refined;
  if (outcome.is_final) {
    if (outcome.state != Number()) return false;
    refined = outcome.transforms;
    refined.is_final = true;
    refinement_.TakeFinal(outcome);
  } else {
    // The final revision will have the number that a revision made now would get.
    if (complete_ || AllEnded() || number <= transforms_.revision) return false;
    if (!refinement_.Take(outcome, graph_)) return false;
    refined = Places();
  }
  refined.revision = number;
  refined.cursors = CursorsOf(sessions_);
  refined.refined = true;
  transforms_ = refined;
  output_->OnRevision(refined, connections(), outcome.submaps);
  return true;
}

void Merger::Finalize() {
  // The source is not ours: what is opened is a view of it.
  struct Borrowed : KeyframeSource {
    explicit Borrowed(KeyframeSource* from) : source(from) {}
    KeyframeRecord Read(const std::string& session, int64_t seq) override { return source->Read(session, seq); }
    KeyframeSource* source;
  };
  OpenKeyframeSource open;
  if (keyframes() != nullptr) open = [this] { return std::make_unique<Borrowed>(keyframes()); };
  Complete();
  TakeRefinement(RunRefinement(
      MakeRefinement(), [&](const std::string& what) { output_->OnProgress(what); }, open));
}

std::vector<Connection> Merger::connections() const {
  std::vector<Connection> all;
  for (const auto& [pair, connection] : graph_.connections()) all.push_back(connection);
  for (const auto& [key, loops] : graph_.loops()) all.push_back(loops);
  return all;
}

}  // namespace mapmend
