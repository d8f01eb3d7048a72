#pragma once

#include <map>
#include <string>
#include <vector>

#include "libs/stream/submap.h"

// What the store knows of submaps that are still growing: who observes what. Descriptors, colours and words are left
// out: they stay in the file.
namespace mapmend {

// Applies a record as Session::Apply and then drops the heavy part of a new keyframe.
std::string ApplyLight(const Record& record, Session* session);

// Keyframes that share at least kMinCovisible map points with this one, strongest first, ties by id; at most
// kMaxCovisible.
inline constexpr int kMinCovisible = 15, kMaxCovisible = 10;
std::vector<KeyframeId> CovisibleKeyframes(const Submap& submap, KeyframeId keyframe);

// Number of map points that each other keyframe of the submap shares with this one; only those with any.
std::map<KeyframeId, int> SharedPoints(const Submap& submap, KeyframeId keyframe);

// Number of map points that the keyframe observes.
int CountMapPoints(const SubmapKeyframe& keyframe);

// The submap a record belongs to; invalid for SessionStarted and SessionEnded.
SubmapId SubmapOf(const RecordBody& body);

}  // namespace mapmend
