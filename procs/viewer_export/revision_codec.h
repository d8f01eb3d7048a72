#pragma once

#include <vector>

#include "procs/viewer_export/map_revision.h"

namespace mapmend {
class connection_t;
class merged_transforms_t;
class revision_part_t;
class revision_t;

// The merger's messages as plain C++. The bytes came from the bus, so what they say is checked: counts that must agree,
// ids, finite values, positive scales. Each throws std::runtime_error with one line that names the field.

EvaluatedConnection DecodeConnection(const connection_t& message);

// Transforms only; tree is filled in, connections are not.
MapRevision DecodeTransforms(const merged_transforms_t& message);

// parts: all parts of the revision.
MapRevision DecodeRevision(const revision_t& message, const std::vector<revision_part_t>& parts);

}  // namespace mapmend
