#include "procs/submap_store/wanted_images.h"

#include <algorithm>

#include "libs/base/checksum.h"

namespace mapmend {

void WantedImages::Add(KeyframeId keyframe, int frame, bool is_stored) {
  if (is_stored) {
    stored_[keyframe] = frame;
  } else {
    awaited_[keyframe] = frame;
  }
}

void WantedImages::Remove(KeyframeId keyframe) {
  awaited_.erase(keyframe);
  stored_.erase(keyframe);
  lost_.erase(keyframe);
  asked_.erase(keyframe);
  Tell(keyframe, Clock::now());
}

void WantedImages::ForgetStored() {
  awaited_.merge(stored_);
  stored_.clear();
}

void WantedImages::Tell(KeyframeId keyframe, Clock::time_point now) {
  told_.push_back(keyframe);
  if (told_.size() > kToldAgain) told_.erase(told_.begin());
  tell_until_ = now + kTellFor;
  has_news_ = true;
}

std::optional<ImageRequest> WantedImages::NextRequest(const std::string& session, Clock::time_point now) {
  for (auto it = awaited_.rbegin(); it != awaited_.rend() && asked_.size() < kAtOnce; ++it) {
    if (!asked_.contains(it->first)) asked_[it->first].due = now;
  }
  ImageRequest request;
  request.session = session;
  for (auto it = asked_.rbegin(); it != asked_.rend(); ++it) {
    Asked& asked = it->second;
    if (asked.due > now) continue;
    asked.due = now + asked.pause;
    asked.pause = std::min<std::chrono::milliseconds>(2 * asked.pause, kMostRetry);
    request.wanted.push_back({it->first, awaited_.at(it->first), static_cast<int>(asked.bytes.size())});
  }
  const bool tells = has_news_ || (now >= tell_next_ && now < tell_until_);
  if (request.wanted.empty() && !tells) return std::nullopt;
  has_news_ = false;
  tell_next_ = now + kTellAgain;
  request.stored = told_;
  return request;
}

std::optional<KeyframeImage> WantedImages::Take(const ImagePiece& piece, Clock::time_point now) {
  const auto asked = asked_.find(piece.image.keyframe);
  if (asked == asked_.end() || awaited_.at(piece.image.keyframe) != piece.image.frame) return std::nullopt;
  if (piece.image.encoding.empty()) {
    lost_[piece.image.keyframe] = piece.image.frame;
    awaited_.erase(piece.image.keyframe);
    asked_.erase(asked);
    return std::nullopt;
  }
  std::vector<uint8_t>& bytes = asked->second.bytes;
  if (piece.offset == 0) bytes.clear();  // from its beginning again
  if (static_cast<size_t>(piece.offset) != bytes.size()) return std::nullopt;
  bytes.insert(bytes.end(), piece.image.bytes.begin(), piece.image.bytes.end());
  asked->second.pause = kFirstRetry;
  asked->second.due = now + kFirstRetry;
  if (bytes.size() < static_cast<size_t>(piece.size)) return std::nullopt;
  if (Crc32(bytes.data(), bytes.size()) != piece.crc32) {
    bytes.clear();
    return std::nullopt;
  }
  KeyframeImage image = piece.image;
  image.bytes = std::move(bytes);
  bytes.clear();
  return image;
}

void WantedImages::Stored(KeyframeId keyframe, Clock::time_point now) {
  if (const auto awaited = awaited_.find(keyframe); awaited != awaited_.end()) {
    stored_.insert(*awaited);
    awaited_.erase(awaited);
  }
  asked_.erase(keyframe);
  Tell(keyframe, now);
}

}  // namespace mapmend
