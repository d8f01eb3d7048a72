#include "libs/bus/recording_file.h"

#include <algorithm>
#include <cstring>
#include <filesystem>
#include <stdexcept>
#include <tuple>

namespace mapmend {
namespace {

// Big-endian: sync word, number of the event (8 bytes), time in microseconds (8), size of the channel's name (4), of
// the data (4), then both (lcm/eventlog.c).
constexpr uint8_t kSync[4] = {0xED, 0xA1, 0xDA, 0x01};
constexpr int64_t kHeaderBytes = 28;
constexpr int64_t kMaxChannel = 255, kMaxData = 256 << 20;

int64_t ReadNumber(const uint8_t* bytes, int size) {
  uint64_t number = 0;
  for (int i = 0; i < size; ++i) number = number << 8 | bytes[i];
  return static_cast<int64_t>(number);
}

}  // namespace

bool RecordingFile::IsLog(const std::string& path) {
  std::ifstream file(path, std::ios::binary);
  char word[sizeof(kSync)];
  return file.read(word, sizeof(word)) && std::memcmp(word, kSync, sizeof(kSync)) == 0;
}

RecordingFile::RecordingFile(const std::string& path) : path_(path) {
  std::error_code error;
  if (!std::filesystem::exists(path, error)) throw std::runtime_error("log " + path + " does not exist");
  file_.open(path, std::ios::binary);
  if (!file_ || std::filesystem::is_directory(path, error)) throw std::runtime_error("log " + path + " cannot be read");
  size_ = static_cast<int64_t>(std::filesystem::file_size(path, error));
  LoggedEvent first;
  if (error || !Next(&first)) throw std::runtime_error("log " + path + " is not an LCM log");
  next_ = 0;
  damages_.clear();
}

RecordingFile::Header RecordingFile::ReadHeader(int64_t offset) {
  Header header;
  uint8_t bytes[kHeaderBytes];
  file_.clear();
  file_.seekg(offset);
  file_.read(reinterpret_cast<char*>(bytes), kHeaderBytes);
  const auto num_read = static_cast<size_t>(file_.gcount());
  header.has_sync = num_read > 0 && std::memcmp(bytes, kSync, std::min(num_read, sizeof(kSync))) == 0;
  if (!file_) return header;  // the file ends in it
  header.utime = ReadNumber(bytes + 12, 8);
  header.channel_size = ReadNumber(bytes + 20, 4);
  header.data_size = ReadNumber(bytes + 24, 4);
  header.end = offset + kHeaderBytes + header.channel_size + header.data_size;
  header.is_plausible = header.channel_size > 0 && header.channel_size <= kMaxChannel && header.data_size <= kMaxData &&
                        header.end <= size_;
  return header;
}

bool RecordingFile::IsBoundary(int64_t offset) {
  if (offset == size_) return true;
  uint8_t word[sizeof(kSync)];
  file_.clear();
  file_.seekg(offset);
  file_.read(reinterpret_cast<char*>(word), sizeof(word));
  return std::memcmp(word, kSync, static_cast<size_t>(file_.gcount())) == 0;
}

int64_t RecordingFile::FindSync(int64_t offset) {
  std::vector<char> buffer(1 << 16);
  while (offset < size_) {
    file_.clear();
    file_.seekg(offset);
    file_.read(buffer.data(), static_cast<std::streamsize>(buffer.size()));
    const auto end = buffer.begin() + file_.gcount();
    const auto found = std::search(buffer.begin(), end, std::begin(kSync), std::end(kSync),
                                   [](char a, uint8_t b) { return static_cast<uint8_t>(a) == b; });
    if (found != end) return offset + (found - buffer.begin());
    if (file_.gcount() < static_cast<std::streamsize>(sizeof(kSync))) break;
    offset += file_.gcount() - static_cast<int64_t>(sizeof(kSync)) + 1;
  }
  return size_;
}

bool RecordingFile::ReadBody(int64_t offset, const Header& header, LoggedEvent* event) {
  event->offset = offset;
  event->utime = header.utime;
  event->channel.resize(static_cast<size_t>(header.channel_size));
  event->data.resize(static_cast<size_t>(header.data_size));
  file_.clear();
  file_.seekg(offset + kHeaderBytes);
  return file_.read(event->channel.data(), header.channel_size) &&
         file_.read(reinterpret_cast<char*>(event->data.data()), header.data_size);
}

bool RecordingFile::ReadAt(int64_t offset, LoggedEvent* event) {
  const Header header = ReadHeader(offset);
  return header.is_plausible && ReadBody(offset, header, event);
}

void RecordingFile::AddDamage(int64_t begin, int64_t end) {
  if (!damages_.empty() && damages_.back().offset + damages_.back().num_bytes == begin) {
    damages_.back().num_bytes += end - begin;
  } else {
    damages_.push_back({begin, end - begin});
  }
}

bool RecordingFile::Next(LoggedEvent* event) {
  while (next_ < size_) {
    const int64_t offset = next_;
    const Header header = ReadHeader(offset);
    const bool fits = header.is_plausible && IsBoundary(header.end);
    if (header.has_sync && header.is_plausible) {
      // Unless another event begins at its end, its length may be wrong, or the next one's beginning.
      const Header behind = fits ? Header() : ReadHeader(header.end);
      const bool next_is_damaged = behind.is_plausible && IsBoundary(behind.end);
      next_ = fits || next_is_damaged ? header.end : FindSync(offset + 1);
      if (!fits && !next_is_damaged) AddDamage(offset, next_);
      return ReadBody(offset, header, event);
    }
    if (fits) {  // all but its sync word is sound
      next_ = header.end;
      AddDamage(offset, offset + static_cast<int64_t>(sizeof(kSync)));
      return ReadBody(offset, header, event);
    }
    next_ = FindSync(offset + 1);
    if (next_ < size_ || !header.has_sync) {
      AddDamage(offset, next_);
    } else {
      has_torn_end_ = true;
    }
  }
  return false;
}

std::vector<std::string> FindLogs(const std::vector<std::string>& paths) {
  std::vector<std::string> logs;
  for (const std::string& path : paths) {
    if (!std::filesystem::is_directory(path)) {
      logs.push_back(path);
      continue;
    }
    std::vector<std::tuple<int64_t, std::string>> parts;  // by the time of their first event
    for (const auto& entry : std::filesystem::directory_iterator(path)) {
      const std::string file = entry.path().string();
      if (!entry.is_regular_file() || !RecordingFile::IsLog(file)) continue;
      LoggedEvent first;
      if (RecordingFile(file).Next(&first)) parts.emplace_back(first.utime, file);
    }
    if (parts.empty()) throw std::runtime_error(path + ": holds no recording of lcm-logger");
    std::sort(parts.begin(), parts.end());
    for (const auto& [utime, file] : parts) logs.push_back(file);
  }
  return logs;
}

}  // namespace mapmend
