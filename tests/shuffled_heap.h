#pragma once

#include <sys/mman.h>

#include <cstdint>
#include <cstdlib>
#include <new>

// Replaces operator new of the program that includes it (in one source file only). While a ShuffledHeap lives, what is
// allocated lies at places that its seed draws: high or low in memory, with another alignment beyond 16 bytes. A result
// that depends on where things lie then differs between seeds. Nothing is freed before the program ends, so this is for
// small things. One thread.
namespace mapmend::testing {

class ShuffledHeap {
 public:
  explicit ShuffledHeap(uint64_t seed) { State().random = 2 * seed + 1, State().enabled = true; }
  ~ShuffledHeap() { State().enabled = false; }
  ShuffledHeap(const ShuffledHeap&) = delete;
  ShuffledHeap& operator=(const ShuffledHeap&) = delete;

  static void* Allocate(size_t size) {
    Heap& heap = State();
    if (heap.enabled) {
      if (heap.begin == nullptr) {
        void* memory = mmap(nullptr, kParts * kPartBytes, PROT_READ | PROT_WRITE,
                            MAP_PRIVATE | MAP_ANONYMOUS | MAP_NORESERVE, -1, 0);
        if (memory != MAP_FAILED) heap.begin = static_cast<char*>(memory);
      }
      heap.random = heap.random * 6364136223846793005u + 1442695040888963407u;
      const size_t part = heap.random >> 61, shift = 16 * (heap.random >> 40 & 3);
      const size_t needed = (size + 15) / 16 * 16 + shift;
      if (heap.begin != nullptr && heap.used[part] + needed <= kPartBytes) {
        char* place = heap.begin + part * kPartBytes + heap.used[part] + shift;
        heap.used[part] += needed;
        return place;
      }
    }
    return std::malloc(size == 0 ? 1 : size);
  }

  static void Free(void* memory) {
    const Heap& heap = State();
    const char* place = static_cast<char*>(memory);
    if (heap.begin != nullptr && place >= heap.begin && place < heap.begin + kParts * kPartBytes) return;
    std::free(memory);
  }

 private:
  static constexpr size_t kParts = 8, kPartBytes = size_t{1} << 32;
  struct Heap {
    char* begin = nullptr;
    size_t used[kParts] = {};
    uint64_t random = 1;
    bool enabled = false;
  };
  static Heap& State() {
    static Heap heap;
    return heap;
  }
};

}  // namespace mapmend::testing

// Not inlined: the compiler would take the pair for a mistake.
[[gnu::noinline]] void* operator new(size_t size) {
  if (void* memory = mapmend::testing::ShuffledHeap::Allocate(size)) return memory;
  throw std::bad_alloc();
}
[[gnu::noinline]] void operator delete(void* memory) noexcept { mapmend::testing::ShuffledHeap::Free(memory); }
[[gnu::noinline]] void operator delete(void* memory, size_t) noexcept { mapmend::testing::ShuffledHeap::Free(memory); }
