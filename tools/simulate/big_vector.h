#pragma once

#if defined(__linux__)
#include <sys/mman.h>
#endif

#include <cstdlib>
#include <new>
#include <vector>

namespace mapmend::simulate {

// Asks for pages of 2 MB: textures, height fields and picture buffers are read here and there, and with pages of 4 KB
// the processor would look up addresses for a good part of the time. Without them all works as well.
template <typename T>
struct BigPages {
  using value_type = T;

  BigPages() = default;
  template <typename U>
  BigPages(const BigPages<U>&) {}

  T* allocate(size_t count) {
    constexpr size_t kPage = size_t{2} << 20;
    if (count > (size_t{1} << 48) / sizeof(T)) throw std::bad_array_new_length();
    const size_t bytes = count * sizeof(T);
    const size_t alignment = bytes >= kPage ? kPage : 64;
    void* memory = std::aligned_alloc(alignment, (bytes + alignment - 1) / alignment * alignment);
    if (memory == nullptr) throw std::bad_alloc();
#if defined(__linux__)
    if (bytes >= kPage) madvise(memory, bytes, MADV_HUGEPAGE);
#endif
    return static_cast<T*>(memory);
  }
  void deallocate(T* memory, size_t) { std::free(memory); }
  template <typename U>
  bool operator==(const BigPages<U>&) const {
    return true;
  }
};

template <typename T>
using BigVector = std::vector<T, BigPages<T>>;

}  // namespace mapmend::simulate
