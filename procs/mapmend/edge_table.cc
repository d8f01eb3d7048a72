#include "procs/mapmend/edge_table.h"

#include <algorithm>
#include <charconv>
#include <cstdio>
#include <map>
#include <nlohmann/json.hpp>
#include <set>
#include <stdexcept>

#include "libs/base/plural.h"
#include "libs/base/text_format.h"

namespace mapmend {
namespace {

int ParseNumber(const std::string& text, const std::string& whole) {
  int number = -1;
  const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), number);
  if (error != std::errc() || end != text.data() + text.size() || number < 0) {
    throw std::runtime_error("'" + whole + "' is not a submap: give its number, or SESSION:NUMBER");
  }
  return number;
}

}  // namespace

EdgeTable::EdgeTable(GraphReply graph, const std::vector<std::string>& session_order) : graph_(std::move(graph)) {
  for (const MergedTransforms::Place& place : graph_.transforms.submaps) submaps_.push_back(place.key);
  const auto rank = [&](const SubmapKey& key) {
    return std::find(session_order.begin(), session_order.end(), key.session) - session_order.begin();
  };
  std::sort(submaps_.begin(), submaps_.end(),
            [&](const SubmapKey& l, const SubmapKey& r) { return std::tuple(rank(l), l) < std::tuple(rank(r), r); });
}

int EdgeTable::Number(const SubmapKey& submap) const {
  const auto it = std::find(submaps_.begin(), submaps_.end(), submap);
  return it == submaps_.end() ? -1 : static_cast<int>(it - submaps_.begin());
}

SubmapKey EdgeTable::FindSubmap(const std::string& text) const {
  const size_t colon = text.rfind(':');
  if (colon == std::string::npos) {
    const auto number = static_cast<size_t>(ParseNumber(text, text));
    if (number >= submaps_.size()) {
      throw std::runtime_error("there is no submap " + text + ": the map has " + std::to_string(submaps_.size()) +
                               (submaps_.empty() ? "" : ", numbered from 0"));
    }
    return submaps_[number];
  }
  const std::string session = text.substr(0, colon);
  const SubmapId number(ParseNumber(text.substr(colon + 1), text));
  std::set<SubmapKey> found;
  for (const SubmapKey& submap : submaps_) {
    if (submap == SubmapKey{session, number}) return submap;
    if (submap.session.starts_with(session) && submap.submap == number) found.insert(submap);
  }
  if (found.size() == 1) return *found.begin();
  throw std::runtime_error(found.empty() ? "there is no submap " + text
                                         : "'" + session + "' is the beginning of several sessions: write more of it");
}

std::vector<const EvaluatedConnection*> EdgeTable::Strongest() const {
  std::vector<const EvaluatedConnection*> connections;
  for (const EvaluatedConnection& c : graph_.connections) connections.push_back(&c);
  std::stable_sort(
      connections.begin(), connections.end(),
      [](const EvaluatedConnection* l, const EvaluatedConnection* r) { return l->strength > r->strength; });
  return connections;
}

std::vector<std::pair<int, int>> EdgeTable::SwitchedOff(const std::vector<EdgeDecision>& decisions) const {
  std::map<std::pair<int, int>, bool> in_force;
  for (const EdgeDecision& d : decisions) {
    const int a = Number(d.a), b = Number(d.b);
    in_force[{std::min(a, b), std::max(a, b)}] = d.disabled;
  }
  std::vector<std::pair<int, int>> pairs;
  for (const auto& [pair, disabled] : in_force) {
    if (disabled) pairs.push_back(pair);
  }
  return pairs;
}

std::string EdgeTable::Json(const std::vector<EdgeDecision>& decisions) const {
  nlohmann::ordered_json json = {
      {"revision", graph_.transforms.revision},   {"refined", graph_.transforms.refined},
      {"final", graph_.transforms.is_final},      {"submaps", nlohmann::ordered_json::array()},
      {"edges", nlohmann::ordered_json::array()}, {"switched_off", SwitchedOff(decisions)}};
  std::map<int, const MergedTransforms::Place*> by_number;
  for (const MergedTransforms::Place& s : graph_.transforms.submaps) by_number[Number(s.key)] = &s;
  for (const auto& [number, s] : by_number) {
    json["submaps"].push_back({{"number", number},
                               {"session", s->key.session},
                               {"submap", s->key.submap.value},
                               {"component", s->component}});
  }
  for (const EvaluatedConnection* c : Strongest()) {
    json["edges"].push_back({{"a", Number(c->a)},
                             {"b", Number(c->b)},
                             {"F", c->num_connected_frames},
                             {"M", c->num_common_points},
                             {"theta_deg", c->median_angle_deg},
                             {"C", c->strength},
                             {"scale", c->b_from_a.scale},
                             {"verdict", ToString(c->verdict)},
                             {"kind", ToString(KindOf(*c))},
                             {"weak", IsWeak(*c)},
                             {"in_tree", c->in_tree},
                             {"reason", c->reason}});
  }
  return json.dump(2, ' ', false, nlohmann::ordered_json::error_handler_t::replace) + "\n";
}

std::string EdgeTable::Text(const std::vector<EdgeDecision>& decisions) const {
  std::string text = Format("%9s %5s %6s %7s %8s %7s  %-11s %-4s  %s\n", "submaps", "F", "M", "theta", "C", "scale",
                            "verdict", "tree", "reason");
  for (const EvaluatedConnection* c : Strongest()) {
    const int a = Number(c->a), b = Number(c->b);
    const std::string pair = a == b ? "loop in " + std::to_string(a) : std::to_string(a) + " - " + std::to_string(b);
    const bool known = c->num_connected_frames > 0;
    text +=
        Format("%9s %5d %6d %7.1f %8.1f %7s  %-11s %-4s  ", pair.c_str(), c->num_connected_frames, c->num_common_points,
               c->median_angle_deg, c->strength, known ? Format("%.3f", c->b_from_a.scale).c_str() : "-",
               ToString(c->verdict), c->in_tree ? "yes" : "") +
        c->reason + "\n";
  }
  std::set<int32_t> components;
  for (const MergedTransforms::Place& s : graph_.transforms.submaps) components.insert(s.component);
  text += Format("revision %lld%s%s: ", static_cast<long long>(graph_.transforms.revision),
                 graph_.transforms.refined ? ", refined" : "", graph_.transforms.is_final ? ", final" : "") +
          Plural(std::ssize(submaps_), "submap") + " in " + Plural(std::ssize(components), "component") + ", " +
          Plural(std::ssize(graph_.transforms.edges), "connection") + " in the tree\n";
  for (const auto& [a, b] : SwitchedOff(decisions)) text += Format("switched off by hand: %d - %d\n", a, b);
  std::map<std::string, int> first;
  for (size_t i = 0; i < submaps_.size(); ++i) first.try_emplace(submaps_[i].session, static_cast<int>(i));
  if (first.size() > 1) {
    for (const auto& [session, number] : first) {
      text += Format("submaps from %d on: session %s\n", number, session.c_str());
    }
  }
  return text;
}

}  // namespace mapmend
