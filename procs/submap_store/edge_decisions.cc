#include "procs/submap_store/edge_decisions.h"

#include <stdexcept>
#include <utility>

#include "libs/wire/codec.h"

namespace mapmend {
namespace {

bool IsValid(const EdgeDecision& d) {
  return IsSessionId(d.a.session) && IsSessionId(d.b.session) && d.a.submap.IsValid() && d.b.submap.IsValid() &&
         d.a != d.b;
}

bool IsSamePair(const EdgeDecision& l, const EdgeDecision& r) {
  return (l.a == r.a && l.b == r.b) || (l.a == r.b && l.b == r.a);
}

}  // namespace

std::vector<EdgeDecision> EdgeDecisions::All() {
  std::vector<EdgeDecision> all;
  auto rows = database_->Prepare(
      "SELECT session_a, submap_a, session_b, submap_b, disabled FROM edge_decision ORDER BY number");
  while (rows->executeStep()) {
    all.push_back({{rows->getColumn(0).getString(), SubmapId(rows->getColumn(1).getInt())},
                   {rows->getColumn(2).getString(), SubmapId(rows->getColumn(3).getInt())},
                   rows->getColumn(4).getInt() != 0});
  }
  return all;
}

EdgeAnswer EdgeDecisions::Decide(const EdgeRequest& request) {
  std::vector<EdgeDecision> all = All();
  const size_t before = all.size();
  for (const EdgeDecision& decision : request.decisions) {
    if (!IsValid(decision)) throw std::runtime_error("a decision names no pair of submaps");
    bool is_disabled = false;
    for (const EdgeDecision& earlier : all) {
      if (IsSamePair(earlier, decision)) is_disabled = earlier.disabled;
    }
    if (is_disabled != decision.disabled) all.push_back(decision);
  }
  if (all.size() > before) {
    SQLite::Transaction transaction(database_->Sql());
    int64_t number = database_->Sql().execAndGet("SELECT ifnull(max(number), 0) FROM edge_decision").getInt64();
    for (size_t i = before; i < all.size(); ++i) {
      auto insert = database_->Prepare(
          "INSERT INTO edge_decision(number, session_a, submap_a, session_b, submap_b, disabled, checksum) "
          "VALUES(?1, ?2, ?3, ?4, ?5, ?6, row_checksum(?1, ?2, ?3, ?4, ?5, ?6))");
      insert->bind(1, ++number);
      insert->bind(2, all[i].a.session);
      insert->bind(3, all[i].a.submap.value);
      insert->bind(4, all[i].b.session);
      insert->bind(5, all[i].b.submap.value);
      insert->bind(6, all[i].disabled ? 1 : 0);
      insert->exec();
    }
    transaction.commit();
  }
  return {{request.id, request.requester}, std::move(all)};
}

}  // namespace mapmend
