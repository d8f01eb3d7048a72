#include "procs/submap_store/edge_decisions.h"

#include <stdexcept>
#include <utility>

namespace mapmend {
namespace {

bool IsValid(const edge_decision_t& d) {
  return IsSessionId(d.session_a) && IsSessionId(d.session_b) && d.submap_a >= 0 && d.submap_b >= 0 &&
         std::pair(d.session_a, d.submap_a) != std::pair(d.session_b, d.submap_b);
}

bool IsSamePair(const edge_decision_t& l, const edge_decision_t& r) {
  const auto a = std::pair(l.session_a, l.submap_a), b = std::pair(l.session_b, l.submap_b);
  const auto c = std::pair(r.session_a, r.submap_a), d = std::pair(r.session_b, r.submap_b);
  return (a == c && b == d) || (a == d && b == c);
}

}  // namespace

std::vector<edge_decision_t> EdgeDecisions::All() {
  std::vector<edge_decision_t> all;
  auto rows = database_->Prepare(
      "SELECT session_a, submap_a, session_b, submap_b, disabled FROM edge_decision ORDER BY number");
  while (rows->executeStep()) {
    edge_decision_t decision{};
    decision.session_a = rows->getColumn(0).getString();
    decision.submap_a = rows->getColumn(1).getInt();
    decision.session_b = rows->getColumn(2).getString();
    decision.submap_b = rows->getColumn(3).getInt();
    decision.disabled = rows->getColumn(4).getInt() != 0 ? 1 : 0;
    all.push_back(std::move(decision));
  }
  return all;
}

edge_decisions_t EdgeDecisions::Decide(const edge_request_t& request) {
  std::vector<edge_decision_t> all = All();
  const size_t before = all.size();
  for (const edge_decision_t& decision : request.decisions) {
    if (!IsValid(decision)) throw std::runtime_error("not a valid edge_decision_t");
    bool is_disabled = false;
    for (const edge_decision_t& earlier : all) {
      if (IsSamePair(earlier, decision)) is_disabled = earlier.disabled != 0;
    }
    if (is_disabled != (decision.disabled != 0)) all.push_back(decision);
  }
  if (all.size() > before) {
    SQLite::Transaction transaction(database_->Sql());
    int64_t number = database_->Sql().execAndGet("SELECT ifnull(max(number), 0) FROM edge_decision").getInt64();
    for (size_t i = before; i < all.size(); ++i) {
      auto insert = database_->Prepare(
          "INSERT INTO edge_decision(number, session_a, submap_a, session_b, submap_b, disabled, checksum) "
          "VALUES(?1, ?2, ?3, ?4, ?5, ?6, row_checksum(?1, ?2, ?3, ?4, ?5, ?6))");
      insert->bind(1, ++number);
      insert->bind(2, all[i].session_a);
      insert->bind(3, all[i].submap_a);
      insert->bind(4, all[i].session_b);
      insert->bind(5, all[i].submap_b);
      insert->bind(6, all[i].disabled != 0 ? 1 : 0);
      insert->exec();
    }
    transaction.commit();
  }
  edge_decisions_t answer{};
  answer.id = request.id;
  answer.requester = request.requester;
  answer.decisions = std::move(all);
  answer.num_decisions = static_cast<int32_t>(answer.decisions.size());
  return answer;
}

}  // namespace mapmend
