#include "libs/bus/outgoing_frames.h"

#include <sys/socket.h>
#include <sys/uio.h>

#include <algorithm>
#include <cerrno>

namespace mapmend {
namespace {

constexpr size_t kMaxPieces = 64, kMaxWriteBytes = 512 << 10;

}  // namespace

bool OutgoingFrames::Push(std::vector<uint8_t> frame, Kind kind) {
  const auto size = static_cast<int64_t>(frame.size());
  if (kind == Kind::kReliable && reliable_bytes_ > 0 && reliable_bytes_ + size > limits_.reliable_bytes) return false;
  *Bytes(kind) += size;
  if (kind == Kind::kControl) {
    const bool is_begun = sent_of_front_ > 0 && frames_.front().kind != Kind::kControl;
    const auto at = frames_.begin() + (is_begun ? 1 : 0) + num_control_;
    frames_.insert(at, {std::move(frame), kind});
    ++num_control_;
    return true;
  }
  frames_.push_back({std::move(frame), kind});
  if (kind == Kind::kBestEffort) DropOldestBestEffort();
  return true;
}

void OutgoingFrames::DropOldestBestEffort() {
  size_t i = sent_of_front_ > 0 ? 1 : 0;
  while (best_effort_bytes_ > limits_.best_effort_bytes && i + 1 < frames_.size()) {
    if (frames_[i].kind != Kind::kBestEffort) {
      ++i;
      continue;
    }
    best_effort_bytes_ -= static_cast<int64_t>(frames_[i].bytes.size());
    frames_.erase(frames_.begin() + static_cast<std::ptrdiff_t>(i));
  }
}

bool OutgoingFrames::Write(int fd) {
  while (!frames_.empty()) {
    iovec pieces[kMaxPieces];
    size_t num_pieces = 0, num_bytes = 0, skip = sent_of_front_;
    for (auto it = frames_.begin(); it != frames_.end() && num_pieces < kMaxPieces && num_bytes < kMaxWriteBytes;
         ++it, ++num_pieces) {
      pieces[num_pieces] = {it->bytes.data() + skip, it->bytes.size() - skip};
      num_bytes += it->bytes.size() - skip;
      skip = 0;
    }
    msghdr message{};
    message.msg_iov = pieces;
    message.msg_iovlen = num_pieces;
    const ssize_t n = sendmsg(fd, &message, MSG_NOSIGNAL | MSG_DONTWAIT);
    if (n < 0) return errno == EAGAIN || errno == EWOULDBLOCK || errno == EINTR;
    size_t done = sent_of_front_ + static_cast<size_t>(n);
    while (!frames_.empty() && done >= frames_.front().bytes.size()) {
      const Frame& front = frames_.front();
      done -= front.bytes.size();
      *Bytes(front.kind) -= static_cast<int64_t>(front.bytes.size());
      if (front.kind == Kind::kControl) --num_control_;
      frames_.pop_front();
    }
    sent_of_front_ = done;
    if (static_cast<size_t>(n) < num_bytes) return true;  // the socket is full
  }
  return true;
}

void OutgoingFrames::Clear() {
  frames_.clear();
  sent_of_front_ = 0;
  num_control_ = 0;
  best_effort_bytes_ = reliable_bytes_ = 0;
}

}  // namespace mapmend
