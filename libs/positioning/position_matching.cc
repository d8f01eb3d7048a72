#include "libs/positioning/position_matching.h"

#include <algorithm>
#include <cmath>
#include <cstdlib>

#include "libs/base/median.h"

namespace mapmend {
namespace {

constexpr int64_t kSameTime = 20000;    // us: taken for the same instant
constexpr int64_t kShortGap = 1000000;  // us: short enough to fill in any case

struct Sample {
  int64_t utime = 0;
  Eigen::Vector3d position;
  size_t index = 0;
};

double MedianInterval(const std::vector<Sample>& samples) {
  std::vector<double> intervals;
  for (size_t i = 1; i < samples.size(); ++i)
    intervals.push_back(static_cast<double>(samples[i].utime - samples[i - 1].utime));
  return Median(intervals);
}

// Where a series was at a time; false across gaps and beyond its ends. index: of the nearer sample.
bool Interpolate(const std::vector<Sample>& series, double max_gap, int64_t utime, Sample* at) {
  const auto behind = std::lower_bound(series.begin(), series.end(), utime,
                                       [](const Sample& s, int64_t time) { return s.utime < time; });
  const auto take = [&](const Sample& s) {
    *at = s;
    return std::abs(s.utime - utime) <= kSameTime;
  };
  if (behind != series.end() && take(*behind)) return true;
  if (behind != series.begin() && take(*(behind - 1))) return true;
  if (behind == series.begin() || behind == series.end()) return false;
  const Sample &a = *(behind - 1), &b = *behind;
  const double gap = static_cast<double>(b.utime - a.utime), share = static_cast<double>(utime - a.utime) / gap;
  if (gap > max_gap) return false;
  *at = share < 0.5 ? a : b;
  at->position = a.position + share * (b.position - a.position);
  return true;
}

std::vector<Sample> TrackSamples(const std::vector<TrackPoint>& track, int session) {
  std::vector<Sample> samples;
  for (size_t i = 0; i < track.size(); ++i) {
    if (track[i].session == session) samples.push_back({track[i].utime, track[i].cam_from_map.Center(), i});
  }
  return samples;
}

double OrElse(double sigma, double otherwise) { return sigma > 0 ? sigma : otherwise; }

void SetSigmas(const PositionFix& fix, const PlacementOptions& options, PositionPair* pair) {
  pair->sigma_horizontal = OrElse(fix.sigma_horizontal_m, options.sigma_horizontal_m);
  // Without an altitude it is as if the flight had stayed at one height, roughly.
  pair->sigma_vertical = fix.HasAltitude() ? OrElse(fix.sigma_vertical_m, options.sigma_vertical_m) : 30;
}

// How well the map fits the fixes with an offset.
struct OffsetCost {
  double cost = 0;  // sum over pairs
  size_t num_pairs = 0;
  double Mean() const { return num_pairs > 0 ? cost / static_cast<double>(num_pairs) : 1e9; }
};

class OffsetSearch {
 public:
  OffsetSearch(const std::vector<std::vector<TrackPoint>>& components, int session, const SessionFixes& fixes,
               const std::vector<Eigen::Vector3d>& enus, const PlacementOptions& options)
      : components_(components), session_(session), fixes_(fixes), enus_(enus), options_(options) {}

  OffsetCost Cost(int64_t offset_us) const {
    OffsetCost sum;
    for (const std::vector<TrackPoint>& track : components_) {
      std::vector<PositionPair> pairs = MatchPositions(track, session_, fixes_, enus_, offset_us, options_);
      constexpr size_t kFewest = 5, kEnough = 400;
      if (pairs.size() < kFewest) continue;
      if (pairs.size() > kEnough) {
        std::vector<PositionPair> some;
        for (size_t i = 0; i < kEnough; ++i) some.push_back(pairs[i * pairs.size() / kEnough]);
        pairs = std::move(some);
      }
      const auto guess = LeastSquaresSimilarity(pairs);
      if (!guess) continue;
      const SimilarityFit fit = FitSimilarity(pairs, std::nullopt, guess);
      if (!fit.success) continue;
      sum.cost += fit.spread * fit.spread * static_cast<double>(pairs.size());
      sum.num_pairs += pairs.size();
    }
    return sum;
  }

  // Strips look like those beside them, so an offset that lets fewer frames have a fix must fit clearly better, and one
  // that loses many does not count.
  double Judge(int64_t offset_us, const OffsetCost& cost) {
    most_pairs_ = std::max(most_pairs_, cost.num_pairs);
    if (cost.num_pairs == 0 || cost.num_pairs * 10 < most_pairs_ * 7) return 1e18;
    const double lost = static_cast<double>(most_pairs_) / static_cast<double>(cost.num_pairs);
    return cost.Mean() * lost * lost * (1 + 1e-9 * std::abs(static_cast<double>(offset_us)));  // rather none
  }

  // Local minima among first, first + step, ..., last, best first; at most `most`.
  std::vector<int64_t> Minima(int64_t first, int64_t last, int64_t step, size_t most) {
    std::vector<OffsetCost> costs;
    for (int64_t offset = first; offset <= last; offset += step) {
      costs.push_back(Cost(offset));
      most_pairs_ = std::max(most_pairs_, costs.back().num_pairs);
    }
    std::vector<double> judged;
    for (size_t i = 0; i < costs.size(); ++i) judged.push_back(Judge(first + static_cast<int64_t>(i) * step, costs[i]));
    std::vector<std::pair<double, int64_t>> minima;
    for (size_t i = 0; i < judged.size(); ++i) {
      const bool falls = i == 0 || judged[i] <= judged[i - 1],
                 rises = i + 1 == judged.size() || judged[i] < judged[i + 1];
      if (falls && rises) minima.emplace_back(judged[i], first + static_cast<int64_t>(i) * step);
    }
    std::sort(minima.begin(), minima.end());
    std::vector<int64_t> offsets;
    for (size_t i = 0; i < std::min(most, minima.size()); ++i) offsets.push_back(minima[i].second);
    return offsets;
  }

  // The best offset between the limits, to some 10 ms.
  int64_t Best(int64_t first, int64_t last) {
    constexpr int64_t kStep = 500000, kFinest = 10000;
    constexpr size_t kTried = 6;
    int64_t best = first;
    double lowest = 1e19;
    for (const int64_t coarse : Minima(first, last, kStep, kTried)) {
      int64_t offset = coarse;
      for (int64_t step = kStep / 5; step >= kFinest; step /= 5) {
        const std::vector<int64_t> finer = Minima(offset - 5 * step, offset + 5 * step, step, 1);
        if (!finer.empty()) offset = finer.front();
      }
      const double cost = Judge(offset, Cost(offset));
      if (cost >= lowest) continue;
      lowest = cost;
      best = offset;
    }
    return best;
  }

 private:
  const std::vector<std::vector<TrackPoint>>& components_;
  const int session_;
  const SessionFixes& fixes_;
  const std::vector<Eigen::Vector3d>& enus_;
  const PlacementOptions& options_;
  size_t most_pairs_ = 0;  // of all offsets tried
};

struct TimeRange {
  int64_t first = 0, last = 0;
  bool is_any = false;
};

TimeRange RangeOf(const std::vector<std::vector<TrackPoint>>& components, int session) {
  TimeRange range;
  for (const std::vector<TrackPoint>& track : components) {
    for (const TrackPoint& point : track) {
      if (point.session != session) continue;
      range.first = range.is_any ? std::min(range.first, point.utime) : point.utime;
      range.last = range.is_any ? std::max(range.last, point.utime) : point.utime;
      range.is_any = true;
    }
  }
  return range;
}

// Offsets to look around where the clocks are apart by more than what is looked for: time zones; and where one of them
// counts from its start, the one that lets both begin together.
std::vector<int64_t> FarOffsets(const TimeRange& frames, const std::vector<PositionFix>& fixes) {
  constexpr int64_t kQuarter = int64_t{900} * 1000000, kOurDays = int64_t{631152000} * 1000000;
  std::vector<int64_t> offsets;
  if ((frames.first < kOurDays) != (fixes.front().utime < kOurDays)) {
    offsets.push_back(frames.first - fixes.front().utime);
    return offsets;
  }
  for (int64_t quarter = 1; quarter <= 56; ++quarter) {
    for (const int64_t sign : {-1, 1}) {
      const int64_t offset = sign * quarter * kQuarter;
      if (fixes.front().utime + offset <= frames.last && fixes.back().utime + offset >= frames.first)
        offsets.push_back(offset);
    }
  }
  return offsets;
}

}  // namespace

std::vector<PositionPair> MatchPositions(const std::vector<TrackPoint>& track, int session, const SessionFixes& fixes,
                                         const std::vector<Eigen::Vector3d>& enus, int64_t offset_us,
                                         const PlacementOptions& options) {
  const std::vector<Sample> frames = TrackSamples(track, session);
  std::vector<Sample> receiver;
  for (size_t i = 0; i < fixes.fixes.size(); ++i) receiver.push_back({fixes.fixes[i].utime + offset_us, enus[i], i});
  std::vector<PositionPair> pairs;
  if (frames.empty() || receiver.empty()) return pairs;
  const double frame_interval = MedianInterval(frames), fix_interval = MedianInterval(receiver);
  const bool fixes_are_dense = fix_interval > 0 && fix_interval < 0.75 * frame_interval;
  const std::vector<Sample>&sparse = fixes_are_dense ? frames : receiver, &dense = fixes_are_dense ? receiver : frames;
  const double interval = fixes_are_dense ? fix_interval : frame_interval;
  const double max_gap = std::max(2.5 * interval, static_cast<double>(kShortGap));
  for (const Sample& sample : sparse) {
    Sample other;
    if (!Interpolate(dense, max_gap, sample.utime, &other)) continue;
    PositionPair pair;
    pair.utime = sample.utime;
    pair.fix = fixes_are_dense ? other.index : sample.index;
    pair.map = fixes_are_dense ? sample.position : other.position;
    pair.enu = fixes_are_dense ? other.position : sample.position;
    SetSigmas(fixes.fixes[pair.fix], options, &pair);
    pairs.push_back(pair);
  }
  return pairs;
}

std::optional<PositionPair> PositionAt(const TrackPoint& frame, const SessionFixes& fixes,
                                       const std::vector<Eigen::Vector3d>& enus, int64_t offset_us,
                                       const PlacementOptions& options) {
  constexpr int64_t kMaxGap = 2500000;  // us; on which a flight is straight enough
  const int64_t utime = frame.utime - offset_us;
  const auto behind = std::lower_bound(fixes.fixes.begin(), fixes.fixes.end(), utime - kMaxGap,
                                       [](const PositionFix& fix, int64_t time) { return fix.utime < time; });
  std::vector<Sample> near;
  for (auto it = behind; it != fixes.fixes.end() && it->utime <= utime + kMaxGap; ++it) {
    const auto i = static_cast<size_t>(it - fixes.fixes.begin());
    near.push_back({it->utime, enus[i], i});
  }
  Sample at;
  if (near.empty() || !Interpolate(near, static_cast<double>(kMaxGap), utime, &at)) return std::nullopt;
  PositionPair pair;
  pair.utime = frame.utime;
  pair.fix = at.index;
  pair.map = frame.cam_from_map.Center();
  pair.enu = at.position;
  SetSigmas(fixes.fixes[at.index], options, &pair);
  return pair;
}

ClockOffset EstimateClockOffset(const std::vector<std::vector<TrackPoint>>& components, int session,
                                const SessionFixes& fixes, const std::vector<Eigen::Vector3d>& enus,
                                const PlacementOptions& options) {
  ClockOffset clock;
  const TimeRange frames = RangeOf(components, session);
  if (fixes.fixes.empty() || !frames.is_any) return clock;
  OffsetSearch search(components, session, fixes, enus, options);
  const auto limit = static_cast<int64_t>(options.max_clock_offset_s * 1e6);
  std::vector<int64_t> centers = {0};
  const bool overlap =
      fixes.fixes.front().utime <= frames.last + limit && fixes.fixes.back().utime >= frames.first - limit;
  if (!overlap) centers = FarOffsets(frames, fixes.fixes);
  if (centers.empty()) {
    clock.problem = "no position is of the time of the flight";
    return clock;
  }
  int64_t best = centers.front();
  double lowest = 1e19;
  for (const int64_t center : centers) {
    const int64_t candidate = search.Best(center - limit, center + limit);
    const double cost = search.Judge(candidate, search.Cost(candidate));
    if (cost >= lowest) continue;
    lowest = cost;
    best = candidate;
  }
  const OffsetCost at_best = search.Cost(best), at_zero = search.Cost(0);
  // The curvature of the cost tells how well the offset is known.
  constexpr int64_t kAside = 500000;
  const double curvature =
      (search.Cost(best - kAside).Mean() + search.Cost(best + kAside).Mean() - 2 * at_best.Mean()) / 0.25;
  const double n = std::max<double>(1, static_cast<double>(at_best.num_pairs));
  const double sigma = curvature > 1e-9 ? std::sqrt(2 * std::max(at_best.Mean(), 1e-6) / (3 * n * curvature)) : 1e9;
  const bool is_needed = at_zero.num_pairs * 10 < at_best.num_pairs * 7;
  const bool is_better = at_best.Mean() < (1 - options.min_gain) * (1 - options.min_gain) * at_zero.Mean();
  const bool is_known = std::abs(static_cast<double>(best)) * 1e-6 > 3 * sigma;
  if (!is_needed && (!is_better || !is_known)) return clock;
  clock.offset_us = best;
  clock.sigma_s = std::max(sigma, 0.01);
  return clock;
}

}  // namespace mapmend
