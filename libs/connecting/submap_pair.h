#pragma once

#include <compare>
#include <map>
#include <string>
#include <vector>

#include "libs/connecting/local_window.h"
#include "libs/stream/stream_cursor.h"
#include "libs/stream/submap.h"

namespace mapmend {

// All that the stream has told so far, by session.
using Sessions = std::map<std::string, Session>;

// Two submaps of the graph. Submaps are ordered by when their session began, then by session and number, so that the
// frame of the map does not depend on what was found when.
struct SubmapPair {
  SubmapKey older, younger;
  auto operator<=>(const SubmapPair&) const = default;
};

bool IsOlder(const Sessions& sessions, const SubmapKey& l, const SubmapKey& r);
// Of two different submaps, given in either order.
SubmapPair MakePair(const Sessions& sessions, const SubmapKey& a, const SubmapKey& b);
// All submaps, the oldest first: the vertices of the graph.
std::vector<SubmapKey> SubmapsByAge(const Sessions& sessions);
SubmapView ViewSubmap(const Sessions& sessions, const SubmapKey& key);
std::vector<StreamCursor> CursorsOf(const Sessions& sessions);

}  // namespace mapmend
