#include "procs/submap_store/bow_search.h"

#include <algorithm>
#include <cmath>

#include "procs/submap_store/blob.h"
#include "procs/submap_store/submap_model.h"

namespace mapmend {
namespace {

constexpr size_t kMaxTrackers = 8;
constexpr int kMaxResults = 200;

// Rows are numbered from 1, the index counts sessions from 0.
int32_t IndexNumber(int64_t session) { return static_cast<int32_t>(session - 1); }

}  // namespace

void BowSearch::AddSession(const SessionRow& session) { sessions_[session.id].row = session; }

void BowSearch::StartSubmap(int64_t session, SubmapId submap, int64_t seq) {
  submaps_[{session, submap}].start_seq = seq;
}

void BowSearch::AddKeyframe(int64_t session, SubmapId submap, KeyframeId keyframe, int64_t seq, const BowVector& bow) {
  IndexEntry entry;
  entry.session = IndexNumber(session);
  entry.submap = submap.value;
  entry.keyframe = keyframe.value;
  entry.seq = seq;
  sessions_.at(session).handles[keyframe.value] = index_.Add(bow, entry);
  covisible_.emplace_back();
}

void BowSearch::RemoveKeyframe(int64_t session, KeyframeId keyframe, int64_t seq) {
  const auto& handles = sessions_.at(session).handles;
  const auto it = handles.find(keyframe.value);
  if (it != handles.end()) index_.Remove(it->second, seq);
}

void BowSearch::EndSubmap(int64_t session, SubmapId submap, int64_t seq) { submaps_[{session, submap}].end_seq = seq; }

void BowSearch::SetCovisible(int64_t session, KeyframeId keyframe, const std::vector<int32_t>& covisible) {
  const auto& handles = sessions_.at(session).handles;
  const auto it = handles.find(keyframe.value);
  if (it == handles.end()) return;
  std::vector<int32_t>& found = covisible_[static_cast<size_t>(it->second)];
  found.clear();
  found.reserve(covisible.size());
  for (const int32_t id : covisible) {
    const auto other = handles.find(id);
    if (other != handles.end()) found.push_back(other->second);
  }
}

void BowSearch::FinishSubmap(int64_t session, SubmapId submap) { submaps_[{session, submap}].is_final = true; }

void BowSearch::Load() {
  for (const SessionRow& session : database_->Sessions()) AddSession(session);
  {
    auto rows = database_->Prepare("SELECT session, submap, start_seq, end_seq, has_geometry FROM submap");
    while (rows->executeStep()) {
      SubmapInfo& info = submaps_[{rows->getColumn(0).getInt64(), SubmapId(rows->getColumn(1).getInt())}];
      info.start_seq = rows->getColumn(2).getInt64();
      info.end_seq = rows->getColumn(3).isNull() ? -1 : rows->getColumn(3).getInt64();
      info.is_final = rows->getColumn(4).getInt() != 0;
    }
  }
  // Both tables are read in the order of their keys, which are the same.
  auto rows = database_->Prepare(
      "SELECT k.session, k.submap, k.keyframe, k.seq, k.removed_seq, b.words, b.weights FROM keyframe k "
      "JOIN keyframe_bow b ON b.session = k.session AND b.keyframe = k.keyframe ORDER BY k.session, k.keyframe");
  while (rows->executeStep()) {
    const int64_t session = rows->getColumn(0).getInt64();
    const KeyframeId keyframe(rows->getColumn(2).getInt());
    AddKeyframe(session, SubmapId(rows->getColumn(1).getInt()), keyframe, rows->getColumn(3).getInt64(),
                {UnpackAscending(rows->getColumn(5)), ReadBlob<float>(rows->getColumn(6))});
    if (!rows->getColumn(4).isNull()) RemoveKeyframe(session, keyframe, rows->getColumn(4).getInt64());
  }
  auto geometry = database_->Prepare("SELECT session, keyframe, covisible FROM keyframe_geometry");
  while (geometry->executeStep()) {
    SetCovisible(geometry->getColumn(0).getInt64(), KeyframeId(geometry->getColumn(1).getInt()),
                 ReadBlob<int32_t>(geometry->getColumn(2)));
  }
}

const BowSearch::SessionInfo* BowSearch::FindSession(const std::string& uuid) const {
  for (const auto& [id, session] : sessions_) {
    if (session.row.uuid == uuid) return &session;
  }
  return nullptr;
}

// The submap as it was, for this requester: each asks for later and later states, but not all at the same pace.
const Submap& BowSearch::AsOf(const std::string& requester, const SubmapIndex& submap, int64_t seq) {
  const SubmapInfo& info = submaps_.at(submap);
  if (info.end_seq >= 0) seq = std::min(seq, info.end_seq);
  auto it = std::find_if(trackers_.begin(), trackers_.end(), [&](const CachedTracker& cached) {
    return cached.requester == requester && cached.submap == submap;
  });
  if (it == trackers_.end()) {
    if (trackers_.size() >= kMaxTrackers) trackers_.pop_back();
    trackers_.push_front(
        {requester, submap, SubmapTracker(database_, sessions_.at(submap.first).row, submap.second, info.start_seq)});
  } else {
    trackers_.splice(trackers_.begin(), trackers_, it);
  }
  return trackers_.front().tracker.AsOf(seq);
}

std::vector<int32_t> BowSearch::ToHandles(int64_t session, const std::vector<KeyframeId>& keyframes) const {
  const auto& handles = sessions_.at(session).handles;
  std::vector<int32_t> result;
  for (const KeyframeId id : keyframes) {
    const auto it = handles.find(id.value);
    if (it != handles.end()) result.push_back(it->second);
  }
  return result;
}

std::vector<int32_t> BowSearch::Covisible(const std::string& requester, int32_t handle, int64_t seq) {
  const IndexEntry& entry = index_.Entry(handle);
  const SubmapIndex submap{entry.session + 1, SubmapId(entry.submap)};
  const SubmapInfo& info = submaps_.at(submap);
  if (info.is_final && seq >= info.end_seq) return covisible_[static_cast<size_t>(handle)];
  return ToHandles(submap.first, CovisibleKeyframes(AsOf(requester, submap, seq), KeyframeId(entry.keyframe)));
}

BowAnswer::Status BowSearch::MakeScope(const std::vector<StreamCursor>& cursors, IndexScope* scope) const {
  scope->last_seq.assign(sessions_.empty() ? 0 : static_cast<size_t>(sessions_.rbegin()->first), -1);
  for (const StreamCursor& cursor : cursors) {
    if (!IsSessionId(cursor.session)) return BowAnswer::Status::kBadQuery;
    const SessionInfo* session = FindSession(cursor.session);
    if (session == nullptr || cursor.seq > session->row.cumulative) return BowAnswer::Status::kNotYet;
    scope->last_seq[static_cast<size_t>(IndexNumber(session->row.id))] = cursor.seq;
  }
  std::vector<std::pair<std::string, int32_t>> by_uuid;
  for (const auto& [id, session] : sessions_) by_uuid.emplace_back(session.row.uuid, IndexNumber(id));
  std::sort(by_uuid.begin(), by_uuid.end());
  scope->session_rank.resize(scope->last_seq.size());
  for (size_t i = 0; i < by_uuid.size(); ++i)
    scope->session_rank[static_cast<size_t>(by_uuid[i].second)] = static_cast<int32_t>(i);
  return BowAnswer::Status::kOk;
}

BowSearch::Asked BowSearch::FindAsked(const BowQuery& query, const IndexScope& scope) {
  Asked asked;
  asked.status = BowAnswer::Status::kUnknownKeyframe;
  asked.session = FindSession(query.session);
  if (asked.session == nullptr) return asked;
  const SessionRow& row = asked.session->row;
  const int64_t seq = scope.last_seq[static_cast<size_t>(IndexNumber(row.id))];
  if (seq < 0) {  // its own session must be among the cursors
    asked.status = BowAnswer::Status::kBadQuery;
    return asked;
  }
  const auto handle = asked.session->handles.find(query.keyframe.value);
  if (handle == asked.session->handles.end()) return asked;
  asked.handle = handle->second;
  asked.entry = index_.Entry(handle->second);
  if (asked.entry.seq > seq || asked.entry.removed_seq <= seq) return asked;
  asked.submap = &AsOf(query.requester, {row.id, SubmapId(asked.entry.submap)}, seq);
  if (asked.submap->keyframes.contains(query.keyframe)) asked.status = BowAnswer::Status::kOk;
  return asked;
}

AdaptiveThresholds BowSearch::DescribeAsked(const Asked& asked, const std::map<KeyframeId, int>& shared_points,
                                            BowAnswer* answer) const {
  const auto keyframe = asked.submap->keyframes.find(answer->keyframe);
  if (keyframe != asked.submap->keyframes.begin()) answer->adjacent = std::prev(keyframe)->first;
  const int num_points = CountMapPoints(keyframe->second);
  std::vector<Overlap> overlaps;
  overlaps.reserve(shared_points.size());
  for (const auto& [id, shared] : shared_points)
    overlaps.push_back({id.value, static_cast<double>(shared) / num_points});
  answer->nearby = KeyframeId(ChooseNearby(overlaps, answer->adjacent.value, options_.thresholds));

  const auto find_bow = [&](KeyframeId id) {
    const auto found = asked.session->handles.find(id.value);
    return found == asked.session->handles.end() ? nullptr : &index_.Bow(found->second);
  };
  const AdaptiveThresholds thresholds = ComputeThresholds(index_.Bow(asked.handle), find_bow(answer->adjacent),
                                                          find_bow(answer->nearby), options_.thresholds);
  answer->n0 = thresholds.n0;
  answer->n1 = thresholds.n1;
  answer->s0 = static_cast<float>(thresholds.s0);
  answer->s1 = static_cast<float>(thresholds.s1);
  answer->k = static_cast<float>(thresholds.k);
  answer->l = static_cast<float>(thresholds.l);
  return thresholds;
}

void BowSearch::Propose(const Selection& selection, BowAnswer* answer) const {
  answer->max_common_words = static_cast<int32_t>(std::lround(selection.max_common_words));
  answer->best_group_score = static_cast<float>(selection.best_group_score);
  for (const Candidate& candidate : selection.candidates) {
    const IndexEntry& found = index_.Entry(candidate.handle);
    answer->proposals.push_back({sessions_.at(found.session + 1).row.uuid, SubmapId(found.submap),
                                 KeyframeId(found.keyframe), static_cast<float>(candidate.group_score),
                                 static_cast<float>(candidate.score), candidate.common_words});
  }
}

BowAnswer BowSearch::Query(const BowQuery& query) {
  BowAnswer answer;
  answer.id = query.id;
  answer.requester = query.requester;
  answer.session = query.session;
  answer.keyframe = query.keyframe;
  IndexScope scope;
  answer.status = MakeScope(query.cursors, &scope);
  if (answer.status != BowAnswer::Status::kOk) return answer;
  const Asked asked = FindAsked(query, scope);
  answer.status = asked.status;
  if (answer.status != BowAnswer::Status::kOk) return answer;

  const std::map<KeyframeId, int> shared_points = SharedPoints(*asked.submap, query.keyframe);
  const AdaptiveThresholds thresholds = DescribeAsked(asked, shared_points, &answer);
  if (query.same_submap) {
    std::vector<KeyframeId> covisible;
    for (const auto& [id, shared] : shared_points) {
      if (shared >= kMinCovisible) covisible.push_back(id);
    }
    scope.excluded_handles = ToHandles(asked.session->row.id, covisible);
    scope.excluded_handles.push_back(asked.handle);
    if (answer.adjacent.IsValid()) scope.excluded_handles.push_back(asked.session->handles.at(answer.adjacent.value));
  } else {
    scope.excluded_session = asked.entry.session;
    scope.excluded_submap = asked.entry.submap;
  }
  SelectionOptions selection_options = options_.selection;
  if (query.max_results > 0) selection_options.max_results = std::min(query.max_results, kMaxResults);
  const BowVector& bow = index_.Bow(asked.handle);
  const auto covisible = [&](int32_t other) {
    return Covisible(query.requester, other, scope.last_seq[static_cast<size_t>(index_.Entry(other).session)]);
  };
  Propose(
      SelectCandidates(index_.Query(bow, scope, thresholds.k), bow.Size(), thresholds, covisible, selection_options),
      &answer);
  return answer;
}

int64_t BowSearch::Bytes() const {
  int64_t bytes = index_.Bytes() + static_cast<int64_t>(covisible_.capacity() * sizeof(covisible_[0]));
  for (const auto& list : covisible_) bytes += static_cast<int64_t>(list.capacity() * sizeof(int32_t)) + 8;
  for (const auto& [id, session] : sessions_) {
    bytes += static_cast<int64_t>(session.handles.size() * 40 + session.handles.bucket_count() * sizeof(void*));
  }
  return bytes;
}

}  // namespace mapmend
