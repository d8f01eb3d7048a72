#pragma once

#include <compare>
#include <type_traits>

namespace mapmend {

// Where something stands in a list of its kind; -1 is "none". Reads as an int, as a subscript for example, but neither
// an int nor an index of another kind becomes one, or is compared with one, by mistake.
template <typename Kind>
class Index {
 public:
  constexpr Index() = default;
  constexpr explicit Index(int value) : value_(value) {}
  template <typename Other>
  explicit Index(Index<Other>) = delete;

  constexpr operator int() const { return value_; }  // NOLINT(google-explicit-constructor)
  constexpr bool IsNone() const { return value_ < 0; }
  constexpr Index& operator++() {
    ++value_;
    return *this;
  }
  constexpr Index& operator--() {  // of 0: none
    --value_;
    return *this;
  }
  friend constexpr auto operator<=>(Index a, Index b) = default;
  friend constexpr bool operator==(Index a, Index b) = default;

 private:
  int value_ = -1;
};

template <typename Kind, typename Other>
requires(!std::is_same_v<Kind, Other>) bool operator==(Index<Kind>, Index<Other>) = delete;
template <typename Kind, typename Other>
requires(!std::is_same_v<Kind, Other>) std::strong_ordering operator<=>(Index<Kind>, Index<Other>) = delete;

using KeyframeIndex = Index<struct KeyframeKind>;  // in the working map
using PointIndex = Index<struct PointKind>;        // in the working map
using FeatureIndex = Index<struct FeatureKind>;    // in a frame

}  // namespace mapmend
