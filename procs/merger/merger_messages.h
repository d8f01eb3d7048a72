#pragma once

#include <mapmend/connection_t.hpp>
#include <mapmend/merged_transforms_t.hpp>
#include <mapmend/revision_part_t.hpp>
#include <mapmend/revision_t.hpp>
#include <vector>

#include "libs/merging/merger.h"

// What the merger says, in its wire form.
namespace mapmend {

connection_t ToMessage(const Connection& connection);
merged_transforms_t ToMessage(const MergedTransforms& transforms);
revision_t ToMessage(const MergedTransforms& transforms, const std::vector<Connection>& connections, int num_parts);
revision_part_t ToMessage(const RefinedSubmap& submap, int64_t revision, int part);

}  // namespace mapmend
