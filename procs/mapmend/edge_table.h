#pragma once

#include <cstdint>
#include <string>
#include <utility>
#include <vector>

#include "libs/wire/revision_codec.h"

namespace mapmend {

// The connection graph for a person. Submaps are numbered as in the report: sessions in the store's order, then by
// submap.
class EdgeTable {
 public:
  EdgeTable(GraphReply graph, const std::vector<std::string>& session_order);

  // A submap by its number, or by SESSION:NUMBER with the number within the session, whose name may be cut short.
  // Throws std::runtime_error with one line: unknown, or not the only one.
  SubmapKey FindSubmap(const std::string& text) const;

  // A line per evaluated pair, most strength first, then the state of the graph and the decisions in force.
  std::string Text(const std::vector<EdgeDecision>& decisions) const;
  // The same as a JSON object: revision, refined, final, submaps [{number, session, submap, component}], edges [{a, b,
  // F, M, theta_deg, C, scale, verdict, in_tree, reason}] and switched_off [[a, b]], submaps by their numbers.
  std::string Json(const std::vector<EdgeDecision>& decisions) const;

 private:
  std::vector<const EvaluatedConnection*> Strongest() const;  // first
  // Pairs of numbers, lower first, that a person has switched off.
  std::vector<std::pair<int, int>> SwitchedOff(const std::vector<EdgeDecision>& decisions) const;
  int Number(const SubmapKey& submap) const;  // -1: unknown

  GraphReply graph_;
  std::vector<SubmapKey> submaps_;  // by number
};

}  // namespace mapmend
