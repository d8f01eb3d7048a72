#include "procs/mapmend/log_reader.h"

#include <algorithm>
#include <stdexcept>

#include "libs/base/checksum.h"
#include "libs/bus/bus.h"
#include "libs/bus/channels.h"
#include "libs/stream/frames_read.h"
#include "libs/wire/record_checksums.h"

namespace mapmend {
namespace {

constexpr size_t kMaxDamagesTold = 3;

// The channel without the prefix of the run; nullptr if it is none of the stream's.
const char* StreamChannel(const std::string& recorded) {
  for (const char* channel : kRecordChannels) {
    if (recorded.ends_with(channel)) return channel;
  }
  return nullptr;
}

// "record 7", "records 7 to 9".
std::string Records(int64_t first, int64_t last) {
  return first == last ? "record " + std::to_string(first)
                       : "records " + std::to_string(first) + " to " + std::to_string(last);
}

}  // namespace

LogReader::LogReader(const std::vector<std::string>& paths) {
  for (const std::string& path : paths) files_.push_back(std::make_unique<RecordingFile>(path));
  for (size_t i = 0; i < files_.size(); ++i) ReadFile(static_cast<int>(i));
  bool any = false;
  for (auto& [id, session] : sessions_) {
    Choose(id, &session);
    any = any || session.sound.contains(0);
  }
  if (!any) {
    throw std::runtime_error("log " + paths.front() +
                             " holds no session of mapmend whose first record is there and whole");
  }
  // The first record says the vocabulary.
  while (ready_.empty() && Advance()) continue;
}

void LogReader::ReadFile(int file) {
  LoggedEvent event;
  while (files_[static_cast<size_t>(file)]->Next(&event)) {
    if (const char* channel = StreamChannel(event.channel)) {
      OnRecord(event, channel, file);
    } else if (event.channel.ends_with(channels::kChecksum)) {
      OnChecksums(event, file);
    }
  }
}

void LogReader::OnRecord(const LoggedEvent& event, const char* channel, int file) {
  const int size = static_cast<int>(event.data.size());
  const DecodedRecord decoded = DecodeRecord(channel, event.data.data(), size);
  const auto header = PeekHeader(event.data.data(), size);
  if (!decoded.record && num_refused_++ == 0) first_refusal_ = decoded.error;
  if (!header) return;
  sessions_[header->session].recorded[header->seq].push_back(
      {{file, event.offset},
       RecordChecksum(channel, event.data.data(), event.data.size()),
       channel,
       decoded.record.has_value()});
}

void LogReader::OnChecksums(const LoggedEvent& event, int file) {
  const auto list = Decode<RecordChecksumList>(event.data).value;
  if (!list) return;
  files_with_checksums_.insert(file);
  int64_t seq = list->first_seq;
  for (const uint32_t checksum : list->crc32) {
    // More than one, if a message with checksums was damaged itself: then the record fits one of them.
    auto& known = sessions_[list->session].checksums[seq++];
    if (std::find(known.begin(), known.end(), checksum) == known.end()) known.push_back(checksum);
  }
}

void LogReader::Choose(const std::string& id, Session* session) {
  for (const auto& [seq, candidates] : session->recorded) {
    const auto known = session->checksums.find(seq);
    const auto is_sound = [&](const Candidate& candidate) {
      if (!candidate.decodes) return false;
      return !files_with_checksums_.contains(candidate.place.file) ||
             (known != session->checksums.end() &&
              std::find(known->second.begin(), known->second.end(), candidate.checksum) != known->second.end());
    };
    const auto found = std::find_if(candidates.begin(), candidates.end(), is_sound);
    if (found != candidates.end()) {
      session->sound[seq] = *found;
      continue;
    }
    const Candidate& first = candidates.front();
    complaints_.push_back("session " + id + ", record " + std::to_string(seq) + " (" + first.channel + ") at byte " +
                          std::to_string(first.place.offset) + " of " +
                          files_[static_cast<size_t>(first.place.file)]->Path() + " is damaged and left out");
  }
  session->recorded.clear();
  session->checksums.clear();
}

std::optional<EncodedRecord> LogReader::Next() {
  while (ready_.empty() && !at_end_) at_end_ = !Advance();
  if (ready_.empty()) return std::nullopt;
  EncodedRecord record = std::move(ready_.front());
  ready_.pop_front();
  return record;
}

// Sessions are interleaved as they were recorded.
bool LogReader::Advance() {
  std::pair<const std::string, Session>* next = nullptr;
  for (auto& item : sessions_) {
    Session& session = item.second;
    if (session.ended) continue;
    if (session.sound.empty() || (session.next_seq == 0 && !session.sound.contains(0))) {
      Close(item.first, &session);
      if (!ready_.empty()) return true;
      continue;
    }
    if (next == nullptr || session.sound.begin()->second.place < next->second.sound.begin()->second.place) next = &item;
  }
  if (next == nullptr) {
    ComplainOfFiles();
    return false;
  }
  auto& [id, session] = *next;
  const auto [seq, candidate] = *session.sound.begin();
  session.sound.erase(session.sound.begin());
  LoggedEvent event;
  DecodedRecord decoded;
  if (files_[static_cast<size_t>(candidate.place.file)]->ReadAt(candidate.place.offset, &event)) {
    decoded = DecodeRecord(candidate.channel, event.data.data(), static_cast<int>(event.data.size()));
  }
  if (!decoded.record) return true;  // the file has changed since: a hole
  if (seq > session.next_seq) OnHole(id, seq, &session);
  Deliver({id, seq, candidate.channel, std::move(event.data)}, *decoded.record, &session);
  return true;
}

void LogReader::OnHole(const std::string& id, int64_t next_sound, Session* session) {
  complaints_.push_back("session " + id + ": " + Records(session->next_seq, next_sound - 1) +
                        " cannot be had; it goes on with the next submap");
  CloseSubmap(id, session, "record_lost", "a record is missing in the recording");
  session->is_skipping = true;
}

void LogReader::Deliver(EncodedRecord encoded, const Record& record, Session* session) {
  const auto* ended = std::get_if<SessionEnded>(&record.body);
  if (session->is_skipping && ended == nullptr && !std::holds_alternative<SubmapStarted>(record.body)) {
    ++session->num_skipped;
    session->next_seq = encoded.seq + 1;
    return;
  }
  if (session->num_skipped > 0) {
    complaints_.push_back("session " + encoded.session + ": " + std::to_string(session->num_skipped) +
                          " records before record " + std::to_string(encoded.seq) +
                          " depend on what is lost and are left out");
    session->num_skipped = 0;
  }
  session->is_skipping = false;
  session->next_seq = encoded.seq + 1;
  session->last_utime = record.header.utime;
  if (const auto* started = std::get_if<SessionStarted>(&record.body)) {
    if (vocabulary_hash_.empty()) vocabulary_hash_ = started->vocabulary_hash;
    session->start = *started;
  } else if (const auto* submap = std::get_if<SubmapStarted>(&record.body)) {
    session->open_submap = submap->submap;
  } else if (std::holds_alternative<SubmapEnded>(record.body)) {
    session->open_submap = SubmapId();
  } else if (ended != nullptr) {
    session->ended = true;
  } else if (const auto* keyframe = std::get_if<KeyframeRecord>(&record.body)) {
    NoteFrame(keyframe->frame, session);
  } else if (const auto* update = std::get_if<MapUpdate>(&record.body)) {
    for (const TrackedFrame& frame : update->frames) NoteFrame(frame.frame, session);
  }
  ready_.push_back(std::move(encoded));
}

void LogReader::NoteFrame(int frame, Session* session) {
  if (session->first_frame < 0 || frame < session->first_frame) session->first_frame = frame;
  session->last_frame = std::max(session->last_frame, frame);
}

void LogReader::CloseSubmap(const std::string& id, Session* session, const std::string& reason,
                            const std::string& detail) {
  if (!session->open_submap.IsValid()) return;
  ready_.push_back(
      EncodeRecord({{id, session->next_seq++, session->last_utime},
                    SubmapEnded{session->open_submap, reason, detail, session->last_frame, session->last_utime}}));
  session->open_submap = SubmapId();
}

void LogReader::Close(const std::string& id, Session* session) {
  session->ended = true;
  if (session->next_seq == 0) {
    if (!session->sound.empty())
      complaints_.push_back("session " + id + ": its start is not in the log, so it cannot be mapped");
    session->sound.clear();
    return;
  }
  complaints_.push_back("session " + id + " breaks off after record " + std::to_string(session->next_seq - 1));
  CloseSubmap(id, session, "end_of_input", "the recording ends here");
  const int num_frames = CountFramesRead(session->start, session->first_frame, session->last_frame);
  ready_.push_back(EncodeRecord({{id, session->next_seq++, session->last_utime}, SessionEnded{num_frames}}));
}

void LogReader::ComplainOfFiles() {
  for (const auto& file : files_) {
    const auto& damages = file->Damages();
    for (size_t i = 0; i < std::min(damages.size(), kMaxDamagesTold); ++i) {
      complaints_.push_back("log " + file->Path() + " is damaged: " + std::to_string(damages[i].num_bytes) +
                            " bytes from byte " + std::to_string(damages[i].offset) + " on");
    }
    if (damages.size() > kMaxDamagesTold) {
      complaints_.push_back("log " + file->Path() + " is damaged at " +
                            std::to_string(damages.size() - kMaxDamagesTold) + " more places");
    }
  }
  if (num_refused_ > 0) {
    complaints_.push_back(std::to_string(num_refused_) + " messages were refused; the first: " + first_refusal_);
  }
}

int64_t LogReader::NumLeft() const {
  int64_t num = std::ssize(ready_);
  for (const auto& [id, session] : sessions_) num += std::ssize(session.sound);
  return num;
}

std::map<std::string, int64_t> LogReader::LastRecords() const {
  std::map<std::string, int64_t> last;
  for (const auto& [id, session] : sessions_) {
    if (session.next_seq > 0) last[id] = session.next_seq - 1;
  }
  return last;
}

}  // namespace mapmend
