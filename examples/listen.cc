// Listens to a flight that is being mapped, and prints a line whenever the merger tells where the submaps stand.
//     listen [URL]            (default: $LCM_DEFAULT_URL, else tcpq://127.0.0.1:7700, where `mapmend hub` listens)

#include <csignal>
#include <cstdio>
#include <exception>
#include <mapmend/merged_transforms_t.hpp>

#include "mapmend/bus/bus.h"
#include "mapmend/bus/channels.h"
#include "mapmend/geometry/similarity3.h"

namespace {

volatile std::sig_atomic_t stopped = 0;

void Print(const mapmend::merged_transforms_t& told) {
  std::printf("revision %lld: %d submaps, %d connections in the tree%s\n", static_cast<long long>(told.revision),
              told.num_submaps, told.num_edges, told.is_final ? ", final" : "");
  for (const mapmend::merged_submap_t& submap : told.submaps) {
    const mapmend::Similarity3 root_from_submap = mapmend::SimilarityFromArray(submap.root_from_submap);
    std::printf("  submap %d in map %d, scale %.3f\n", submap.submap, submap.component, root_from_submap.scale);
  }
  std::fflush(stdout);
}

}  // namespace

int main(int argc, char** argv) {
  std::signal(SIGINT, [](int) { stopped = 1; });
  std::signal(SIGTERM, [](int) { stopped = 1; });
  try {
    mapmend::Bus bus(mapmend::ResolveLcmUrl(argc > 1 ? argv[1] : ""), "");
    const mapmend::Subscription subscription = bus.Subscribe<mapmend::merged_transforms_t>(
        mapmend::channels::kMergedTransforms, mapmend::Delivery::kKeepAll, Print);
    while (!stopped) bus.Handle(200);
  } catch (const std::exception& e) {
    std::fprintf(stderr, "listen: %s\n", e.what());
    return 1;
  }
}
