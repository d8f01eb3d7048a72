// What the refinement of a merged map costs as the map grows (synthetic_survey.h).
//
// memory_mb is what the refinement takes at its peak beyond the submaps it is given.
//
//   merged_refinement_benchmark                       100, 300, 500, 1000 and 2000 keyframes
//   merged_refinement_benchmark --benchmark_filter=500

#include <benchmark/benchmark.h>

#include <cmath>
#include <fstream>
#include <memory>
#include <string>

#include "libs/geometry/sim3_closed_form.h"
#include "libs/merging/merged_refinement.h"
#include "tests/benchmark/synthetic_survey.h"

namespace mapmend {
namespace {

using testing::SyntheticSurvey;

constexpr int kPerStrip = SyntheticSurvey::kPerStrip;

struct Survey {
  std::unique_ptr<SyntheticSurvey> made;
  Session session;
  std::vector<SubmapView> views;
  std::vector<RefinementLink> links;
  std::vector<Similarity3> tree;
};

std::unique_ptr<Survey> MakeSurvey(int num_keyframes) {
  auto survey = std::make_unique<Survey>();
  survey->made = testing::MakeSyntheticSurvey("survey", num_keyframes);
  survey->session = survey->made->flight->Model();
  for (const auto& [id, submap] : survey->session.submaps) {
    survey->views.push_back({&submap, survey->session.info.pinhole, survey->session.info.pyramid});
  }
  // Neighbouring submaps are connected along the strips that lie side by side, as the merger would find it.
  survey->tree = {Similarity3()};
  for (int s = 0; s + 1 < static_cast<int>(survey->views.size()); ++s) {
    std::optional<Similarity3> b_from_a;
    for (int i = 0; i < kPerStrip; i += 4) {
      const int first = 2 * kPerStrip * s;
      const KeyframeId a(first + 2 * kPerStrip - 1 - i), b(first + 2 * kPerStrip + i);
      const ConnectedFrames c = VerifyConnectedFrames(survey->views[s], a, survey->views[s + 1], b, {});
      if (!c.success) continue;
      survey->links.push_back({s, s + 1, a, b, c.b_from_a});
      if (!b_from_a) b_from_a = c.b_from_a;
    }
    survey->tree.push_back(survey->tree.back() * b_from_a.value_or(Similarity3()).Inverse());
  }
  return survey;
}

double CenterError(const MergedMap& map, const std::vector<Rigid3>& world_from_keyframe) {
  std::vector<Eigen::Vector3d> estimated, truth;
  for (const MergedKeyframe& k : map.keyframes) {
    estimated.push_back(k.cam_from_root.Center());
    truth.push_back(world_from_keyframe[k.keyframe->id.value].translation);
  }
  const auto fit = HornAlignment(estimated, truth);
  if (!fit) return NAN;
  double sum = 0;
  for (size_t i = 0; i < truth.size(); ++i) sum += (*fit * estimated[i] - truth[i]).squaredNorm();
  return std::sqrt(sum / static_cast<double>(truth.size()));
}

// A line of /proc/self/status in megabytes: VmRSS, memory now; VmHWM, its peak since ForgetPeak.
double MemoryMb(const std::string& name) {
  std::ifstream status("/proc/self/status");
  for (std::string line; std::getline(status, line);) {
    if (line.starts_with(name + ":")) return std::stod(line.substr(name.size() + 1)) / 1024;
  }
  return NAN;
}

void ForgetPeak() { std::ofstream("/proc/self/clear_refs") << "5"; }

void BM_Refine(benchmark::State& state) {
  const std::unique_ptr<Survey> survey = MakeSurvey(static_cast<int>(state.range(0)));
  MergedRefinementResult result;
  ForgetPeak();
  const double memory_before = MemoryMb("VmRSS");
  for (auto _ : state) result = RefineMergedMap(survey->views, survey->tree, survey->links, {});
  state.counters["memory_mb"] = MemoryMb("VmHWM") - memory_before;
  int points = 0;
  for (const MergedPoint& p : result.map.points) points += !p.track.empty();
  state.counters["points"] = points;
  state.counters["observations"] = result.summary.after.num_observations;
  state.counters["submaps"] = static_cast<double>(survey->views.size());
  state.counters["error_before_m"] =
      CenterError(MakeMergedMap(survey->views, survey->tree), survey->made->flight->world_from_keyframe());
  state.counters["error_after_m"] = CenterError(result.map, survey->made->flight->world_from_keyframe());
  if (!result.summary.success) state.SkipWithError(result.summary.reason.c_str());
}
BENCHMARK(BM_Refine)
    ->Arg(100)
    ->Arg(300)
    ->Arg(500)
    ->Arg(1000)
    ->Arg(2000)
    ->Unit(benchmark::kSecond)
    ->Iterations(1)
    ->UseRealTime()
    ->MeasureProcessCPUTime();

}  // namespace
}  // namespace mapmend

BENCHMARK_MAIN();
