#pragma once

#include <atomic>
#include <functional>
#include <thread>
#include <vector>

namespace mapmend::simulate {

// Calls body(begin, end) for consecutive chunks of [0, count) on num_threads threads. Chunks must not depend on each
// other; then the result does not depend on num_threads.
inline void ParallelFor(int count, int chunk, int num_threads, const std::function<void(int, int)>& body) {
  std::atomic<int> next{0};
  const auto work = [&] {
    for (int begin = next.fetch_add(chunk); begin < count; begin = next.fetch_add(chunk)) {
      body(begin, std::min(begin + chunk, count));
    }
  };
  std::vector<std::thread> threads;
  for (int i = 1; i < num_threads; ++i) threads.emplace_back(work);
  work();
  for (auto& thread : threads) thread.join();
}

}  // namespace mapmend::simulate
