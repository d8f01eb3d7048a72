#include "libs/connecting/wide_search.h"

#include <algorithm>
#include <cstdlib>
#include <limits>
#include <tuple>

#include "libs/base/options.h"

namespace mapmend {
namespace {

// Shortest time between frames of the two, seconds; negative for different sessions.
double TravelTime(const SubmapKey& a, const WideSide& in_a, const SubmapKey& b, const WideSide& in_b) {
  if (a.session != b.session) return -1;
  int64_t least = std::numeric_limits<int64_t>::max();
  for (const WideFrame& f : in_a.frames) {
    for (const WideFrame& g : in_b.frames) least = std::min(least, std::abs(f.utime - g.utime));
  }
  return 1e-6 * static_cast<double>(least);
}

// Whether a connection's matches lie where a transform puts them.
bool Agrees(const Sessions& sessions, const Connection& known, const Similarity3& b_from_a,
            double max_disagreement_px) {
  const SubmapView a = ViewSubmap(sessions, known.a), b = ViewSubmap(sessions, known.b);
  for (size_t i = 0; i < known.evidence.size(); ++i) {
    const ConnectedFrames& e = known.evidence[i];
    if (known.agrees[i] && MedianErrorPx(ResolveMatches(a, b, e.a_in_b, e.b_in_a), b_from_a) <= max_disagreement_px)
      return true;
  }
  return false;
}

}  // namespace

std::string WideSearchOptions::Check() const { return CheckOptions(*this); }

bool WideSearch::HasWide(const SubmapKey& key) const {
  const Submap& submap = *ViewSubmap(*sessions_, key).submap;
  return submap.ended && submap.wide.size() >= 2;
}

std::vector<SubmapKey> WideSearch::WideSubmaps() const {
  std::vector<SubmapKey> keys = SubmapsByAge(*sessions_);
  std::erase_if(keys, [&](const SubmapKey& key) { return !HasWide(key); });
  return keys;
}

std::vector<WideFrame> WideSearch::Frames(const SideKey& key) const {
  const Submap& submap = *ViewSubmap(*sessions_, key.submap).submap;
  std::vector<std::tuple<int64_t, KeyframeId, const SubmapWideFeatures*>> ordered;
  for (const auto& [id, wide] : submap.wide) {
    if (submap.keyframes.contains(id) || submap.removed_keyframes.contains(id))
      ordered.emplace_back(wide.utime, id, &wide);
  }
  std::sort(ordered.begin(), ordered.end());
  const size_t n = std::min(ordered.size(), static_cast<size_t>(options_.max_frames));
  const size_t begin = key.end == End::kEnd ? ordered.size() - n : 0;
  std::vector<WideFrame> frames;
  for (size_t i = begin; i < begin + n; ++i) {
    const auto& [utime, id, wide] = ordered[i];
    TrackedFrame frame;
    frame.keyframe = id;
    WideFrame& f = frames.emplace_back();
    f.keyframe = submap.Resolved(frame).keyframe;
    f.is_keyframe = f.keyframe == id;
    f.utime = utime;
    f.cam_from_submap = submap.CamFromSubmap(frame);
    f.features = Features(key.submap, *wide);
  }
  return frames;
}

std::shared_ptr<const WideFeatures> WideSearch::Features(const SubmapKey& key, const SubmapWideFeatures& wide) const {
  if (wide.features) return wide.features;
  return std::make_shared<const WideFeatures>(keyframes_->ReadWide(key.session, wide.seq).features);
}

std::vector<WideFrame> WideSearch::FramesBeyond(const SideKey& key, KeyframeId keyframe) const {
  const Session& session = sessions_->at(key.submap.session);
  auto submap = session.submaps.find(key.submap.submap);
  if (key.end == End::kBegin && submap == session.submaps.begin()) return {};
  if (key.end == End::kBegin) --submap;
  std::vector<WideFrame> frames;
  for (const auto& [index, wide] : submap->second.wide_between) {
    WideFrame& f = frames.emplace_back();
    f.keyframe = keyframe;
    f.utime = wide.utime;
    f.features = Features({key.submap.session, submap->first}, wide);
  }
  if (key.end == End::kBegin) std::reverse(frames.begin(), frames.end());
  return frames;
}

const WideSide& WideSearch::Side(const SideKey& key) {
  const auto it = sides_.find(key);
  if (it != sides_.end()) return it->second;
  WideSide& side = sides_[key];
  std::vector<WideFrame> frames = Frames(key);
  if (frames.empty()) return side;
  // The frame that lies next to what lies beyond is the last to be added.
  const KeyframeId nearest = (key.end == End::kEnd ? frames.back() : frames.front()).keyframe;
  if (key.end == End::kBegin) std::reverse(frames.begin(), frames.end());
  side = MakeWideSide(ViewSubmap(*sessions_, key.submap), std::move(frames), options_.connection.tracks);
  ExtendWideSide(FramesBeyond(key, nearest), options_.connection.tracks, options_.extension, &side);
  return side;
}

bool WideSearch::AreApart(const ConnectionGraph& graph, const SubmapKey& a, const SubmapKey& b) const {
  const std::vector<SubmapKey> keys = SubmapsByAge(*sessions_);
  const auto component = [&](const SubmapKey& key) {
    return graph.forest().component[static_cast<size_t>(std::find(keys.begin(), keys.end(), key) - keys.begin())];
  };
  return component(a) != component(b);
}

bool WideSearch::IsWeak(const ConnectionGraph& graph, const SubmapKey& a, const SubmapKey& b) const {
  const auto known = graph.connections().find(MakePair(*sessions_, a, b));
  return known != graph.connections().end() && known->second.verdict == Connection::Verdict::kAccepted &&
         known->second.kind == ConnectionKind::kOrb && known->second.num_common_points < options_.weak_common_points;
}

bool WideSearch::Verify(const SideKey& a, const SideKey& b, ConnectionGraph* graph, std::set<SubmapPair>* looked_at) {
  if (!verified_.insert(std::minmax(a, b)).second) return false;
  const SubmapPair pair = MakePair(*sessions_, a.submap, b.submap);
  const auto known = graph->connections().find(pair);
  // What a person or a cycle has ruled out is not tried again.
  if (known != graph->connections().end() && known->second.verdict == Connection::Verdict::kDeactivated) return false;
  const SideKey &older = pair.older == a.submap ? a : b, &younger = pair.older == a.submap ? b : a;
  const WideSide &in_older = Side(older), &in_younger = Side(younger);
  progress_();
  const bool is_known = known != graph->connections().end() && known->second.verdict == Connection::Verdict::kAccepted;
  const auto agrees = [&](const Similarity3& b_from_a) {
    return is_known && Agrees(*sessions_, known->second, b_from_a, options_.max_disagreement_px);
  };
  WideConnection connection =
      VerifyWideConnection(in_older, in_younger, TravelTime(older.submap, in_older, younger.submap, in_younger),
                           options_.connection, agrees);
  ++num_verified_;
  progress_();
  // What is known already is only put in the place of what agrees with it.
  if (is_known && !(connection.success && agrees(connection.frames.front().b_from_a))) return false;
  for (ConnectedFrames& frames : connection.frames) graph->Add(pair, std::move(frames));
  looked_at->insert(pair);
  if (!connection.success) return false;
  graph->Solve(*sessions_, {pair}, false);
  return !AreApart(*graph, a.submap, b.submap);
}

// A submap's beginning against the end of the one before; if that does not hold, of those before that.
void WideSearch::BridgeInTime(ConnectionGraph* graph, std::set<SubmapPair>* looked_at) {
  const std::vector<SubmapKey> keys = WideSubmaps();
  for (size_t i = 0; i < keys.size(); ++i) {
    int tried = 0;
    for (size_t j = i; j-- > 0 && tried < options_.num_submaps;) {
      if (keys[j].session != keys[i].session) continue;
      ++tried;
      if (AreApart(*graph, keys[j], keys[i]) || IsWeak(*graph, keys[j], keys[i]))
        Verify({keys[j], End::kEnd}, {keys[i], End::kBegin}, graph, looked_at);
    }
  }
}

// What is still apart: the middle frame of one end against that of another tells whether to look closer.
void WideSearch::BridgeAlike(ConnectionGraph* graph, std::set<SubmapPair>* looked_at) {
  const std::vector<SubmapKey> keys = WideSubmaps();
  std::vector<Candidate> candidates;
  const auto middle = [&](const SideKey& key) {
    const WideSide& side = Side(key);
    return side.frames[side.frames.size() / 2].features;
  };
  for (size_t i = 0; i < keys.size(); ++i) {
    for (size_t j = 0; j < i; ++j) {
      if (!AreApart(*graph, keys[j], keys[i])) continue;
      for (const End end_j : {End::kBegin, End::kEnd}) {
        for (const End end_i : {End::kBegin, End::kEnd}) {
          Candidate c{{keys[j], end_j}, {keys[i], end_i}};
          if (verified_.contains(std::minmax(c.a, c.b)) || Side(c.a).frames.empty() || Side(c.b).frames.empty())
            continue;
          c.num_alike =
              static_cast<int>(MatchWide(*middle(c.a), *middle(c.b), options_.connection.registration.matching).size());
          if (c.num_alike >= options_.min_alike) candidates.push_back(c);
          progress_();
        }
      }
    }
  }
  std::stable_sort(candidates.begin(), candidates.end(),
                   [](const Candidate& l, const Candidate& r) { return l.num_alike > r.num_alike; });
  int tried = 0;
  for (const Candidate& c : candidates) {
    if (tried >= options_.max_pairs) break;
    if (!AreApart(*graph, c.a.submap, c.b.submap)) continue;
    ++tried;
    Verify(c.a, c.b, graph, looked_at);
  }
}

std::set<SubmapPair> WideSearch::Bridge(ConnectionGraph* graph) {
  std::set<SubmapPair> looked_at;
  if (WideSubmaps().size() < 2) return looked_at;
  sides_.clear();
  verified_.clear();
  graph->Solve(*sessions_, {}, true);
  BridgeInTime(graph, &looked_at);
  BridgeAlike(graph, &looked_at);
  sides_.clear();
  return looked_at;
}

}  // namespace mapmend
