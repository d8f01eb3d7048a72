#include "libs/wire/outbox.h"

#include <fcntl.h>
#include <spdlog/spdlog.h>
#include <sys/file.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <cerrno>
#include <cstring>
#include <stdexcept>

namespace mapmend {
namespace {

// Little-endian: magic "MMOB", CRC-32 of all that follows, size of all that follows, seq, length of session, session,
// length of channel, channel, payload.
constexpr uint32_t kMagic = 0x424f4d4d;
constexpr size_t kHeader = 12;
constexpr uint32_t kMaxEntry = 256u << 20;
constexpr int64_t kNumberBytes = 200;        // more than an entry without payload takes
constexpr int64_t kCompactBytes = 64 << 20;  // of acknowledged entries at the beginning of the file

uint32_t Crc32(const uint8_t* data, size_t size) {
  static const auto table = [] {
    std::array<uint32_t, 256> t{};
    for (uint32_t i = 0; i < 256; ++i) {
      uint32_t c = i;
      for (int bit = 0; bit < 8; ++bit) c = (c & 1) ? 0xedb88320u ^ (c >> 1) : c >> 1;
      t[i] = c;
    }
    return t;
  }();
  uint32_t crc = 0xffffffffu;
  for (size_t i = 0; i < size; ++i) crc = table[(crc ^ data[i]) & 0xff] ^ (crc >> 8);
  return crc ^ 0xffffffffu;
}

template <typename T>
void Put(T value, std::vector<uint8_t>* bytes) {
  const size_t at = bytes->size();
  bytes->resize(at + sizeof(T));
  std::memcpy(bytes->data() + at, &value, sizeof(T));
}

std::vector<uint8_t> Serialize(const EncodedRecord& record) {
  std::vector<uint8_t> body;
  body.reserve(record.data.size() + 128);
  Put(record.seq, &body);
  for (const std::string* text : {&record.session, &record.channel}) {
    Put(static_cast<uint8_t>(text->size()), &body);
    body.insert(body.end(), text->begin(), text->end());
  }
  body.insert(body.end(), record.data.begin(), record.data.end());
  std::vector<uint8_t> entry;
  entry.reserve(kHeader + body.size());
  Put(kMagic, &entry);
  Put(Crc32(body.data(), body.size()), &entry);
  Put(static_cast<uint32_t>(body.size()), &entry);
  entry.insert(entry.end(), body.begin(), body.end());
  return entry;
}

std::optional<EncodedRecord> ParseBody(const std::vector<uint8_t>& body) {
  EncodedRecord record;
  size_t at = sizeof(record.seq);
  if (body.size() < at) return std::nullopt;
  std::memcpy(&record.seq, body.data(), at);
  for (std::string* text : {&record.session, &record.channel}) {
    if (at >= body.size() || at + 1 + body[at] > body.size()) return std::nullopt;
    text->assign(reinterpret_cast<const char*>(&body[at + 1]), body[at]);
    at += 1 + static_cast<size_t>(text->size());
  }
  record.data.assign(body.begin() + static_cast<std::ptrdiff_t>(at), body.end());
  return record;
}

// The record of the entry at offset, if it is whole. *size: bytes of the entry; *magic_ok: whether it begins as one.
std::optional<EncodedRecord> ReadEntry(int fd, int64_t offset, int64_t* size, bool* magic_ok) {
  uint8_t header[kHeader];
  *magic_ok = false;
  if (pread(fd, header, kHeader, offset) != static_cast<ssize_t>(kHeader)) return std::nullopt;
  uint32_t words[3];
  std::memcpy(words, header, kHeader);
  *magic_ok = words[0] == kMagic;
  if (!*magic_ok || words[2] > kMaxEntry) return std::nullopt;
  std::vector<uint8_t> body(words[2]);
  if (pread(fd, body.data(), body.size(), offset + static_cast<int64_t>(kHeader)) !=
      static_cast<ssize_t>(body.size())) {
    return std::nullopt;
  }
  if (Crc32(body.data(), body.size()) != words[1]) return std::nullopt;
  *size = static_cast<int64_t>(kHeader + body.size());
  return ParseBody(body);
}

// So that a file that was just made is still there after a power cut.
void SyncFolder(const std::string& path) {
  const size_t slash = path.rfind('/');
  const std::string folder = slash == std::string::npos ? "." : path.substr(0, slash + 1);
  const int fd = open(folder.c_str(), O_RDONLY | O_DIRECTORY | O_CLOEXEC);
  if (fd < 0) return;
  fsync(fd);
  close(fd);
}

}  // namespace

Outbox::Outbox(const std::string& path, int64_t max_memory_bytes) : path_(path), max_memory_bytes_(max_memory_bytes) {
  if (path_.empty()) return;
  fd_ = open(path_.c_str(), O_RDWR | O_CREAT | O_CLOEXEC, 0644);
  if (fd_ < 0) throw std::runtime_error("outbox " + path_ + ": " + std::strerror(errno));
  if (flock(fd_, LOCK_EX | LOCK_NB) != 0) {
    close(fd_);
    throw std::runtime_error("outbox " + path_ + ": in use by another process");
  }
  try {
    Load();
  } catch (...) {
    close(fd_);
    throw;
  }
  SyncFolder(path_);
}

Outbox::~Outbox() {
  if (fd_ >= 0) close(fd_);
}

// The first whole entry at or after offset; -1: none.
int64_t Outbox::FindEntry(int64_t offset, int64_t file_size) const {
  constexpr int64_t kChunk = 1 << 20, kMagicBytes = sizeof(kMagic);
  std::vector<uint8_t> bytes(static_cast<size_t>(kChunk));
  for (; offset + kMagicBytes <= file_size; offset += kChunk - kMagicBytes + 1) {
    const ssize_t n = pread(fd_, bytes.data(), bytes.size(), offset);
    for (int64_t i = 0; i + kMagicBytes <= n; ++i) {
      if (std::memcmp(bytes.data() + i, &kMagic, sizeof(kMagic)) != 0) continue;
      int64_t size = 0;
      bool magic_ok = false;
      if (ReadEntry(fd_, offset + i, &size, &magic_ok)) return offset + i;
    }
  }
  return -1;
}

void Outbox::Load() {
  const int64_t file_size = lseek(fd_, 0, SEEK_END);
  int64_t offset = 0;
  while (offset < file_size) {
    int64_t size = 0;
    bool magic_ok = false;
    const auto record = ReadEntry(fd_, offset, &size, &magic_ok);
    if (!record) {
      if (offset == 0 && !magic_ok && file_size >= static_cast<int64_t>(kHeader)) {
        throw std::runtime_error("outbox " + path_ + ": not an outbox file; name another one");
      }
      const int64_t next = FindEntry(offset + 1, file_size);
      if (next < 0) {
        spdlog::warn("outbox {}: {} bytes at the end are torn and cut off", path_, file_size - offset);
        break;
      }
      spdlog::warn("outbox {}: {} bytes after record {} are damaged and left out", path_, next - offset, last_seq_);
      offset = next;
      continue;
    }
    if (!session_.empty() && record->session != session_)
      throw std::runtime_error("outbox " + path_ + ": holds two sessions");
    session_ = record->session;
    offset += size;
    if (record->seq <= last_seq_) continue;  // it cannot be: the numbers grow
    last_seq_ = record->seq;
    if (!record->channel.empty()) {
      entries_.push_back({record->seq, offset - size, size, std::nullopt});
    } else {
      begin_ = offset;
    }
  }
  end_ = offset;
  if (end_ < file_size && ftruncate(fd_, end_) != 0) {
    throw std::runtime_error("outbox " + path_ + ": " + std::strerror(errno));
  }
}

void Outbox::Append(EncodedRecord record) {
  if (entries_.empty() && record.session != session_ && fd_ >= 0 && ftruncate(fd_, 0) == 0) begin_ = end_ = 0;
  session_ = record.session;
  last_seq_ = record.seq;
  Entry entry;
  entry.seq = record.seq;
  if (fd_ < 0 || !WriteToFile(record, &entry)) KeepInMemory(std::move(record), &entry);
  entries_.push_back(std::move(entry));
}

bool Outbox::WriteToFile(const EncodedRecord& record, Entry* entry) {
  const std::vector<uint8_t> bytes = Serialize(record);
  const ssize_t n = pwrite(fd_, bytes.data(), bytes.size(), end_);
  if (n == static_cast<ssize_t>(bytes.size())) {
    if (disk_fails_) spdlog::info("outbox {}: writes to disk again", path_);
    disk_fails_ = false;
    entry->offset = end_;
    entry->size = n;
    end_ += n;
    is_dirty_ = true;
    return true;
  }
  // What stays in memory is delivered all the same, unless we are killed first. A part that was written goes away.
  const char* why = n < 0 ? std::strerror(errno) : "no space left on the disk";
  if (!disk_fails_) spdlog::error("outbox {}: {}; from record {} on it is kept in memory only", path_, why, record.seq);
  disk_fails_ = true;
  if (n > 0 && ftruncate(fd_, end_) != 0) spdlog::error("outbox {}: {}", path_, std::strerror(errno));
  return false;
}

void Outbox::KeepInMemory(EncodedRecord record, Entry* entry) {
  const auto size = static_cast<int64_t>(record.data.size());
  int64_t first = -1, last = -1;
  for (auto it = entries_.begin(); memory_bytes_ + size > max_memory_bytes_ && it != entries_.end();) {
    if (!it->in_memory) {
      ++it;
      continue;
    }
    if (first < 0) first = it->seq;
    last = it->seq;
    memory_bytes_ -= static_cast<int64_t>(it->in_memory->data.size());
    it = entries_.erase(it);
  }
  if (first >= 0 && !has_given_up_) {
    spdlog::error("outbox {}: neither store nor disk takes anything, and memory is full: records {} to {} are given up",
                  path_, first, last);
  }
  has_given_up_ = first >= 0;
  memory_bytes_ += size;
  entry->in_memory = std::move(record);
}

void Outbox::Acknowledge(int64_t seq) {
  while (!entries_.empty() && entries_.front().seq <= seq) {
    const Entry& front = entries_.front();
    if (front.offset >= 0) begin_ = front.offset + front.size;
    if (front.in_memory) memory_bytes_ -= static_cast<int64_t>(front.in_memory->data.size());
    entries_.pop_front();
  }
  if (fd_ < 0) return;
  if (entries_.empty()) {
    if (end_ > begin_ || begin_ > kNumberBytes) LeaveOnlyTheNumber();
  } else if (begin_ >= kCompactBytes && begin_ >= end_ / 2) {
    Compact();
  }
}

void Outbox::Sync() {
  if (fd_ < 0 || !is_dirty_) return;
  is_dirty_ = false;
  if (fdatasync(fd_) != 0) spdlog::error("outbox {}: {}", path_, std::strerror(errno));
}

// An entry without channel and payload says that all up to its seq is acknowledged, so that a frontend that starts
// again does not use the numbers twice. Written before the rest is cut off: killed in between, the rest is a torn end.
void Outbox::LeaveOnlyTheNumber() {
  const std::vector<uint8_t> bytes = Serialize({session_, last_seq_, "", {}});
  const auto size = static_cast<int64_t>(bytes.size());
  if (size > end_ || pwrite(fd_, bytes.data(), bytes.size(), 0) != static_cast<ssize_t>(bytes.size())) return;
  if (ftruncate(fd_, size) == 0) begin_ = end_ = size;
  is_dirty_ = true;
}

// Moves what is held into a new file that then takes the name.
void Outbox::Compact() {
  const std::string temporary = path_ + ".new";
  const int fd = open(temporary.c_str(), O_RDWR | O_CREAT | O_TRUNC | O_CLOEXEC, 0644);
  if (fd < 0) return;
  std::vector<uint8_t> buffer(1 << 20);
  int64_t from = begin_, to = 0;
  bool ok = flock(fd, LOCK_EX | LOCK_NB) == 0;
  while (ok && from < end_) {
    const ssize_t n =
        pread(fd_, buffer.data(), std::min<size_t>(buffer.size(), static_cast<size_t>(end_ - from)), from);
    ok = n > 0 && pwrite(fd, buffer.data(), static_cast<size_t>(n), to) == n;
    from += n;
    to += n;
  }
  if (!ok || fdatasync(fd) != 0 || rename(temporary.c_str(), path_.c_str()) != 0) {
    close(fd);
    unlink(temporary.c_str());
    return;
  }
  close(fd_);
  fd_ = fd;
  for (Entry& entry : entries_) {
    if (entry.offset >= 0) entry.offset -= begin_;
  }
  end_ = to;
  begin_ = 0;
}

Outbox::Entries::const_iterator Outbox::At(int64_t seq) const {
  const auto it = std::lower_bound(entries_.begin(), entries_.end(), seq,
                                   [](const Entry& entry, int64_t wanted) { return entry.seq < wanted; });
  return it != entries_.end() && it->seq == seq ? it : entries_.end();
}

std::optional<EncodedRecord> Outbox::Read(int64_t seq) const {
  const auto entry = At(seq);
  if (entry == entries_.end()) return std::nullopt;
  if (entry->in_memory) return entry->in_memory;
  int64_t size = 0;
  bool magic_ok = false;
  return ReadEntry(fd_, entry->offset, &size, &magic_ok);
}

int64_t Outbox::NextSeq(int64_t seq) const {
  const auto it = std::upper_bound(entries_.begin(), entries_.end(), seq,
                                   [](int64_t wanted, const Entry& entry) { return wanted < entry.seq; });
  return it == entries_.end() ? -1 : it->seq;
}

void Outbox::GiveUp(int64_t seq) {
  const auto entry = At(seq);
  if (entry == entries_.end()) return;
  if (entry->in_memory) memory_bytes_ -= static_cast<int64_t>(entry->in_memory->data.size());
  entries_.erase(entry);
}

}  // namespace mapmend
