#pragma once

#include <memory>
#include <optional>
#include <vector>

#include "libs/base/range.h"
#include "procs/frontend/initializer.h"
#include "procs/frontend/local_mapper.h"
#include "procs/frontend/tracker.h"

namespace mapmend {

struct SecondOpinionOptions {
  int min_keyframes = 12;          // of a submap that is asked at all
  int max_keyframes = 160;         // as long as it has no more than these: a submap that has come so far stands
  double max_misfit = 0.6;         // a submap whose observations lie farther than this from its points is doubted, ...
  double min_growth = 1.8;         // ... if that is by this factor more than it has been, ...
  double next_growth = 1.3;        // ... and by this one more than when it was doubted before
  double max_misfit_ratio = 0.75;  // what another map may leave of the misfit, to be better
  double min_kept_share = 0.85;    // of the keyframes that it must place
  double min_observations = 0.7;   // of the observations that it must have

  template <typename Visitor>
  void Visit(Visitor& v) {
    v("min_keyframes", min_keyframes, Range(3, 1e6), "keyframes");
    v("max_keyframes", max_keyframes, Range(0, 1e6), "keyframes");
    v("max_misfit", max_misfit, MoreThan(0), "sigma^2");
    v("min_growth", min_growth, AtLeast(1));
    v("next_growth", next_growth, AtLeast(1));
    v("max_misfit_ratio", max_misfit_ratio, Range(0, 1));
    v("min_kept_share", min_kept_share, Range(0, 1), "of the keyframes");
    v("min_observations", min_observations, Range(0, 1), "of the observations");
  }
};

// A submap that begins with a wrong motion goes on for a long time: every frame is tracked in what the wrong ones
// before have made. But its observations fit worse and worse as the camera sees its points from other sides. Then the
// keyframes are mapped once more, from the last to the first, so that another beginning decides; if that explains the
// same images clearly better, the submap takes its geometry.
class SecondOpinion {
 public:
  // tracker and mapper must outlive it.
  SecondOpinion(const SecondOpinionOptions& options, const InitializerOptions& initializer, const Pinhole& camera,
                const Pyramid& pyramid, const Tracker* tracker, LocalMapper* mapper)
      : options_(options),
        initializer_options_(initializer),
        camera_(camera),
        pyramid_(pyramid),
        tracker_(tracker),
        mapper_(mapper) {}

  // A submap has begun.
  void Begin() { least_misfit_ = doubted_at_ = 0; }
  // After a keyframe has joined the map. If the map is another one now, which of its points takes the place of each of
  // the points that there were, none where none does; the last keyframe stays where it is.
  std::optional<std::vector<PointIndex>> Seek(WorkingMap* map);

 private:
  // The keyframes of a map, mapped anew.
  struct Rival {
    std::unique_ptr<WorkingMap> map;
    std::vector<KeyframeIndex> original;  // of each of its keyframes: which one it is
  };

  // Median squared error of the observations, sigma^2.
  double Misfit(const WorkingMap& map, int* num_observations) const;
  bool IsDoubted(double misfit);
  Rival MapBackwards(const WorkingMap& map) const;
  // The widest beginning with the newest of the frames; how many frames it takes.
  Initialization BeginAt(const std::vector<FramePtr>& frames, size_t first, size_t* second) const;
  void TakePoses(const Rival& rival, double scale, const Rigid3& submap_from_rival, WorkingMap* map) const;
  std::vector<PointIndex> TakeOver(const Rival& rival, WorkingMap* map) const;

  SecondOpinionOptions options_;
  InitializerOptions initializer_options_;
  Pinhole camera_;
  Pyramid pyramid_;
  const Tracker* tracker_;
  LocalMapper* mapper_;
  double least_misfit_ = 0, doubted_at_ = 0;  // 0: not yet
};

}  // namespace mapmend
