#include "libs/connecting/submap_pair.h"

#include <algorithm>
#include <tuple>

namespace mapmend {

bool IsOlder(const Sessions& sessions, const SubmapKey& l, const SubmapKey& r) {
  return std::tuple(sessions.at(l.session).start_utime, l) < std::tuple(sessions.at(r.session).start_utime, r);
}

SubmapPair MakePair(const Sessions& sessions, const SubmapKey& a, const SubmapKey& b) {
  return IsOlder(sessions, a, b) ? SubmapPair{a, b} : SubmapPair{b, a};
}

std::vector<SubmapKey> SubmapsByAge(const Sessions& sessions) {
  std::vector<SubmapKey> keys;
  for (const auto& [id, session] : sessions) {
    for (const auto& [submap_id, submap] : session.submaps) keys.push_back({id, submap_id});
  }
  std::sort(keys.begin(), keys.end(), [&](const SubmapKey& l, const SubmapKey& r) { return IsOlder(sessions, l, r); });
  return keys;
}

SubmapView ViewSubmap(const Sessions& sessions, const SubmapKey& key) {
  const Session& session = sessions.at(key.session);
  return {&session.submaps.at(key.submap), session.info.pinhole, session.info.pyramid, session.info.camera,
          key.session};
}

std::vector<StreamCursor> CursorsOf(const Sessions& sessions) {
  std::vector<StreamCursor> cursors;
  for (const auto& [id, session] : sessions) cursors.push_back({id, session.last_seq});
  return cursors;
}

}  // namespace mapmend
