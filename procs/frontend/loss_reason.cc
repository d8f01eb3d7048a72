#include "procs/frontend/loss_reason.h"

#include <array>

namespace mapmend {
namespace {

// In the order of the enumerators.
constexpr std::array<const char*, 16> kReasons = {"",
                                                  "darkness",
                                                  "blur",
                                                  "small_images",
                                                  "input_gap",
                                                  "too_few_features",
                                                  "too_few_matches",
                                                  "no_common_motion",
                                                  "no_motion",
                                                  "no_parallax",
                                                  "ambiguous",
                                                  "not_confirmed",
                                                  "too_few_inliers",
                                                  "unsupported_pose",
                                                  "inconsistent_motion",
                                                  "end_of_input"};
constexpr std::array<const char*, 5> kMethods = {"", "initialised", "motion", "wide", "descriptors"};

}  // namespace

std::string ToString(LossReason reason) { return kReasons.at(static_cast<size_t>(reason)); }
std::string ToString(TrackMethod method) { return kMethods.at(static_cast<size_t>(method)); }

}  // namespace mapmend
