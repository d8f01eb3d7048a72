#include "procs/submap_store/repair_source.h"

#include <algorithm>
#include <filesystem>
#include <fstream>
#include <map>
#include <set>
#include <stdexcept>

#include "libs/base/checksum.h"
#include "libs/bus/bus.h"
#include "libs/bus/channels.h"
#include "libs/bus/recording_file.h"
#include "libs/wire/outbox.h"
#include "libs/wire/record_checksums.h"
#include "procs/submap_store/database.h"

namespace mapmend {
namespace {

namespace fs = std::filesystem;

bool BeginsWith(const std::string& path, const std::string& magic) {
  std::ifstream file(path, std::ios::binary);
  std::string begin(magic.size(), '\0');
  return file.read(begin.data(), static_cast<std::streamsize>(begin.size())) && begin == magic;
}

bool IsOutbox(const std::string& path) { return BeginsWith(path, "MMOB"); }

void ReadRecording(const std::string& path, const std::function<void(EncodedRecord)>& visit) {
  std::map<std::pair<std::string, int64_t>, std::set<uint32_t>> checksums;
  LoggedEvent event;
  for (RecordingFile file(path); file.Next(&event);) {
    if (!event.channel.ends_with(channels::kChecksum)) continue;
    const auto list = Decode<RecordChecksumList>(event.data).value;
    if (!list) continue;
    int64_t seq = list->first_seq;
    for (const uint32_t crc32 : list->crc32) checksums[{list->session, seq++}].insert(crc32);
  }
  for (RecordingFile file(path); file.Next(&event);) {
    for (const char* channel : kRecordChannels) {
      if (!event.channel.ends_with(channel)) continue;
      const int size = static_cast<int>(event.data.size());
      const auto header = PeekHeader(event.data.data(), size);
      if (!header || !DecodeRecord(channel, event.data.data(), size).record) continue;
      const uint32_t checksum = RecordChecksum(channel, event.data.data(), event.data.size());
      if (!checksums.empty() && !checksums[{header->session, header->seq}].contains(checksum)) continue;
      visit({header->session, header->seq, channel, std::move(event.data)});
      break;
    }
  }
}

void ReadOutbox(const std::string& path, const std::function<void(EncodedRecord)>& visit) {
  const Outbox outbox(path);
  for (int64_t seq = outbox.NextSeq(-1); seq >= 0; seq = outbox.NextSeq(seq)) {
    if (auto record = outbox.Read(seq)) visit(std::move(*record));
  }
}

}  // namespace

bool IsDatabase(const std::string& path) { return BeginsWith(path, "SQLite format 3"); }

void ReadRepairSource(const std::string& path, const std::function<void(EncodedRecord)>& visit) {
  if (RecordingFile::IsLog(path)) {
    ReadRecording(path, visit);
  } else if (IsOutbox(path)) {
    ReadOutbox(path, visit);
  } else if (IsDatabase(path)) {
    Database database(path, Database::Mode::kDamaged);
    for (const SessionRow& session : database.Sessions()) {
      database.ReadRecords(session, 0, session.cumulative, [&](EncodedRecord record) {
        visit(std::move(record));
        return true;
      });
    }
  } else {
    throw std::runtime_error(path + ": is no recording of lcm-logger, no outbox and no map database");
  }
}

std::vector<std::string> FindRepairSources(const std::string& folder) {
  std::vector<std::string> found;
  std::error_code error;
  const auto look = [&](const fs::path& path) {
    if (fs::is_regular_file(path, error) && (RecordingFile::IsLog(path) || IsOutbox(path))) found.push_back(path);
  };
  for (const auto& entry : fs::directory_iterator(folder.empty() ? "." : folder, error)) {
    look(entry.path());
    if (!entry.is_directory(error)) continue;
    for (const auto& inner : fs::directory_iterator(entry.path(), error)) look(inner.path());
  }
  std::sort(found.begin(), found.end());
  return found;
}

}  // namespace mapmend
