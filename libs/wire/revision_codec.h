#pragma once

#include <cstdint>
#include <vector>

#include "libs/bus/bus.h"
#include "libs/stream/revision.h"
#include "libs/stream/store_questions.h"

// What the merger says, to and from its wire form. Decode treats the bytes as untrusted: session names, ids, counts
// that must agree, finite values, unit quaternions and positive scales are checked; the error names the field. What was
// decoded and is encoded again is the same to the last bit.
namespace mapmend {

// A revision of the merged map goes over the bus, and lies in the store, as a head and a part for each refined submap.
struct RevisionHead {  // MAPMEND_REVISION
  MergedTransforms transforms;
  std::vector<EvaluatedConnection> connections;
  int num_parts = 0;  // 0: transforms only
  bool operator==(const RevisionHead&) const = default;
};
struct RevisionPart {  // MAPMEND_REVISION_PART
  int64_t revision = 0;
  int part = 0;  // 0 .. num_parts - 1
  RefinedSubmap submap;
  bool operator==(const RevisionPart&) const = default;
};

// MAPMEND_GRAPH_REQUEST and MAPMEND_GRAPH: the connection graph as the merger knows it now.
struct GraphRequest : Addressed {
  bool operator==(const GraphRequest&) const = default;
};
struct GraphReply : Addressed {
  MergedTransforms transforms;
  int num_decisions = 0;  // decisions of people that are heeded in it
  std::vector<EvaluatedConnection> connections;
  bool operator==(const GraphReply&) const = default;
};

template <>
std::vector<uint8_t> Encode(const EvaluatedConnection& connection);
template <>
Decoded<EvaluatedConnection> Decode(const uint8_t* data, int size);

template <>
std::vector<uint8_t> Encode(const MergedTransforms& transforms);
template <>
Decoded<MergedTransforms> Decode(const uint8_t* data, int size);

template <>
std::vector<uint8_t> Encode(const RevisionHead& head);
template <>
Decoded<RevisionHead> Decode(const uint8_t* data, int size);

template <>
std::vector<uint8_t> Encode(const RevisionPart& part);
template <>
Decoded<RevisionPart> Decode(const uint8_t* data, int size);

template <>
std::vector<uint8_t> Encode(const GraphRequest& request);
template <>
Decoded<GraphRequest> Decode(const uint8_t* data, int size);

template <>
std::vector<uint8_t> Encode(const GraphReply& reply);
template <>
Decoded<GraphReply> Decode(const uint8_t* data, int size);

}  // namespace mapmend
