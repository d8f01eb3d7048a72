#include "libs/merging/restoration_log.h"

#include <algorithm>
#include <functional>
#include <tuple>
#include <utility>

namespace mapmend {
namespace {

// A map: submaps that are merged.
struct Group {
  std::vector<int> submaps;  // youngest first
  int num_tracked = 0;       // of them, those that are tracked now
  int stacked = -1;          // when the last of them was lost; -1: never yet
};

// At equal times what begins comes first, then what is connected, then what ends.
struct Happening {
  enum class Kind { kBegin, kConnection, kEnd };
  int64_t utime = 0;
  Kind kind = Kind::kBegin;
  int index = -1;
  bool operator<(const Happening& r) const { return std::tie(utime, kind, index) < std::tie(r.utime, r.kind, r.index); }
};

std::vector<Happening> InOrder(const std::vector<RestorableSubmap>& submaps,
                               const std::vector<RestorableConnection>& connections) {
  std::vector<Happening> happenings;
  for (size_t i = 0; i < submaps.size(); ++i) {
    const auto index = static_cast<int>(i);
    happenings.push_back({submaps[i].begin_utime, Happening::Kind::kBegin, index});
    if (submaps[i].ended) happenings.push_back({submaps[i].end_utime, Happening::Kind::kEnd, index});
  }
  for (size_t i = 0; i < connections.size(); ++i)
    happenings.push_back({connections[i].utime, Happening::Kind::kConnection, static_cast<int>(i)});
  std::sort(happenings.begin(), happenings.end());
  return happenings;
}

class Restoration {
 public:
  Restoration(const std::vector<RestorableSubmap>& submaps, const std::vector<RestorableConnection>& connections)
      : submaps_(submaps), connections_(connections), group_of_(submaps.size(), -1), ended_(submaps.size(), 0) {}

  void Begin(int submap) {
    const int before = Before(submap);
    // Frames that were tracked afterwards may let it begin before the end of the one that was lost.
    if (before >= 0) End(before);
    group_of_[submap] = static_cast<int>(groups_.size());
    groups_.push_back({{submap}, 1, -1});
    RestorationStep step;
    step.utime = submaps_[submap].begin_utime;
    step.frame = submaps_[submap].begin_frame;
    step.submap = submap;
    step.lost = before;
    Note(std::move(step));
  }

  void End(int submap) {
    if (ended_[submap] || group_of_[submap] < 0) return;
    ended_[submap] = 1;
    Group& group = groups_[group_of_[submap]];
    if (--group.num_tracked == 0) group.stacked = num_stacked_++;
  }

  void Connect(int index) {
    const RestorableConnection& connection = connections_[index];
    const int older = group_of_[connection.older], younger = group_of_[connection.younger];
    if (older < 0 || younger < 0 || older == younger) return;
    Merge(older, younger);
    const bool goes_on = !steps_.empty() && steps_.back().event == RestorationStep::Event::kMerge &&
                         steps_.back().utime == connection.utime && steps_.back().submap == connection.younger;
    RestorationStep step;
    if (goes_on) {
      step = std::move(steps_.back());
      steps_.pop_back();
    }
    step.event = RestorationStep::Event::kMerge;
    step.utime = connection.utime;
    step.frame = connection.frame;
    step.submap = connection.younger;
    step.connections.push_back(index);
    Note(std::move(step));
  }

  std::vector<RestorationStep> Take() { return std::move(steps_); }

 private:
  // The submap of the same session that was tracked before; -1: none.
  int Before(int submap) const {
    for (int i = submap - 1; i >= 0; --i) {
      if (submaps_[i].key.session == submaps_[submap].key.session) return i;
    }
    return -1;
  }

  // Into the map of the younger one, which is the one that is tracked.
  void Merge(int from, int into) {
    Group& source = groups_[from];
    Group& target = groups_[into];
    for (const int submap : source.submaps) group_of_[submap] = into;
    target.submaps.insert(target.submaps.end(), source.submaps.begin(), source.submaps.end());
    std::sort(target.submaps.begin(), target.submaps.end(), std::greater<int>());
    target.num_tracked += source.num_tracked;
    target.stacked = std::max(target.stacked, source.stacked);
    source = {};
  }

  void Note(RestorationStep step) {
    step.unrecovered.clear();
    step.tracked.clear();
    std::vector<const Group*> stack;
    for (const Group& group : groups_) {
      if (group.submaps.empty()) continue;
      if (group.num_tracked > 0)
        step.tracked.push_back(group.submaps);
      else
        stack.push_back(&group);
    }
    std::sort(stack.begin(), stack.end(), [](const Group* l, const Group* r) { return l->stacked < r->stacked; });
    for (const Group* group : stack) step.unrecovered.push_back(group->submaps);
    steps_.push_back(std::move(step));
  }

  const std::vector<RestorableSubmap>& submaps_;
  const std::vector<RestorableConnection>& connections_;
  std::vector<int> group_of_;  // by submap; -1: has not begun
  std::vector<char> ended_;    // by submap
  std::vector<Group> groups_;
  int num_stacked_ = 0;
  std::vector<RestorationStep> steps_;
};

}  // namespace

std::vector<RestorationStep> Restore(const std::vector<RestorableSubmap>& submaps,
                                     const std::vector<RestorableConnection>& connections) {
  Restoration restoration(submaps, connections);
  for (const Happening& happening : InOrder(submaps, connections)) {
    switch (happening.kind) {
      case Happening::Kind::kBegin:
        restoration.Begin(happening.index);
        break;
      case Happening::Kind::kEnd:
        restoration.End(happening.index);
        break;
      case Happening::Kind::kConnection:
        restoration.Connect(happening.index);
        break;
    }
  }
  return restoration.Take();
}

std::string SubmapLetters(int index) {
  std::string letters;
  for (int rest = index + 1; rest > 0; rest = (rest - 1) / 26)
    letters.insert(letters.begin(), static_cast<char>('A' + (rest - 1) % 26));
  return letters;
}

std::string MapLetters(const std::vector<int>& map) {
  std::string text;
  for (const int submap : map) {
    if (!text.empty()) text += '-';
    text += SubmapLetters(submap);
  }
  return text;
}

std::string StackLetters(const std::vector<std::vector<int>>& maps) {
  std::string text;
  for (const std::vector<int>& map : maps) {
    if (!text.empty()) text += ", ";
    text += MapLetters(map);
  }
  return text;
}

}  // namespace mapmend
