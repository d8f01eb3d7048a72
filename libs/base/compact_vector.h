#pragma once

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <memory>
#include <new>
#include <type_traits>
#include <utility>

namespace mapmend {

// A vector of few plain elements, of which there are very many: it takes 8 bytes itself and, unless it is empty, one
// block of just the right size. Every change of its size moves it to another block.
template <typename T>
class CompactVector {
  static_assert(std::is_trivially_destructible_v<T> && alignof(T) <= alignof(std::max_align_t));

 public:
  using value_type = T;
  using iterator = T*;
  using const_iterator = const T*;

  CompactVector() = default;
  explicit CompactVector(size_t size) : block_(NewBlock(size)) { std::uninitialized_value_construct_n(begin(), size); }
  CompactVector(const CompactVector& other) : block_(NewBlock(other.size())) {
    std::uninitialized_copy(other.begin(), other.end(), begin());
  }
  CompactVector(CompactVector&& other) noexcept : block_(std::exchange(other.block_, nullptr)) {}
  CompactVector& operator=(CompactVector other) noexcept {
    std::swap(block_, other.block_);
    return *this;
  }
  ~CompactVector() { ::operator delete(block_); }

  iterator begin() { return block_ ? std::launder(reinterpret_cast<T*>(block_ + kHeader)) : nullptr; }
  iterator end() { return begin() + size(); }
  const_iterator begin() const { return const_cast<CompactVector*>(this)->begin(); }
  const_iterator end() const { return begin() + size(); }
  size_t size() const { return block_ ? *std::launder(reinterpret_cast<const uint32_t*>(block_)) : 0; }
  bool empty() const { return block_ == nullptr; }
  T& operator[](size_t i) { return begin()[i]; }
  const T& operator[](size_t i) const { return begin()[i]; }
  const T& front() const { return *begin(); }
  const T& back() const { return end()[-1]; }

  void insert(const_iterator at, const T& value) {
    CompactVector grown;
    grown.block_ = NewBlock(size() + 1);
    T* next = std::uninitialized_copy(const_iterator(begin()), at, grown.begin());
    new (next) T(value);
    std::uninitialized_copy(at, const_iterator(end()), next + 1);
    *this = std::move(grown);
  }
  void push_back(const T& value) { insert(end(), value); }
  template <typename Predicate>
  void EraseIf(Predicate is_erased) {
    const auto num_kept = static_cast<size_t>(std::remove_if(begin(), end(), is_erased) - begin());
    if (num_kept == size()) return;
    CompactVector kept;
    kept.block_ = NewBlock(num_kept);
    std::uninitialized_copy(begin(), begin() + num_kept, kept.begin());
    *this = std::move(kept);
  }

  friend bool operator==(const CompactVector& l, const CompactVector& r) {
    return std::equal(l.begin(), l.end(), r.begin(), r.end());
  }

 private:
  static constexpr size_t kHeader = std::max(sizeof(uint32_t), alignof(T));

  static std::byte* NewBlock(size_t size) {
    if (size == 0) return nullptr;
    auto* block = static_cast<std::byte*>(::operator new(kHeader + size * sizeof(T)));
    new (block) uint32_t(static_cast<uint32_t>(size));
    return block;
  }

  std::byte* block_ = nullptr;  // the number of elements, then the elements
};

}  // namespace mapmend
