#pragma once

#include <compare>
#include <cstdint>
#include <functional>
#include <string>

namespace mapmend {

// A number that names one kind of thing; -1 is "none". Ids are unique within a session.
template <typename Tag>
struct StrongId {
  int32_t value = -1;

  constexpr StrongId() = default;
  constexpr explicit StrongId(int32_t v) : value(v) {}
  constexpr bool IsValid() const { return value >= 0; }
  constexpr auto operator<=>(const StrongId&) const = default;
};

using SubmapId = StrongId<struct SubmapTag>;
using KeyframeId = StrongId<struct KeyframeTag>;
using MapPointId = StrongId<struct MapPointTag>;

// A submap among all sessions. Ordered by session text, then id.
struct SubmapKey {
  std::string session;
  SubmapId submap;
  auto operator<=>(const SubmapKey&) const = default;
};

}  // namespace mapmend

template <typename Tag>
struct std::hash<mapmend::StrongId<Tag>> {
  size_t operator()(const mapmend::StrongId<Tag>& id) const noexcept { return std::hash<int32_t>()(id.value); }
};
