#include "procs/mapmend/log_reader.h"

#include <filesystem>
#include <fstream>
#include <lcm/lcm-cpp.hpp>
#include <stdexcept>

#include "libs/bus/channels.h"

namespace mapmend {
namespace {

constexpr const char* kStreamChannels[] = {channels::kSession, channels::kSubmap, channels::kKeyframe,
                                           channels::kMapUpdate};

// The channel without the prefix of the run; empty if it is none of the stream's.
std::string StreamChannel(const std::string& recorded) {
  for (const char* channel : kStreamChannels) {
    if (recorded.ends_with(channel)) return channel;
  }
  return {};
}

// Each event of an LCM log begins with this word, big-endian (lcm/eventlog.c).
bool LooksLikeLog(const std::string& path) {
  std::ifstream file(path, std::ios::binary);
  unsigned char word[4] = {0, 0, 0, 0};
  file.read(reinterpret_cast<char*>(word), sizeof(word));
  return file && word[0] == 0xED && word[1] == 0xA1 && word[2] == 0xDA && word[3] == 0x01;
}

}  // namespace

LogReader::LogReader(const std::string& path) : path_(path) {
  std::error_code error;
  if (!std::filesystem::exists(path, error)) throw std::runtime_error("log " + path + " does not exist");
  if (!std::ifstream(path) || std::filesystem::is_directory(path, error))
    throw std::runtime_error("log " + path + " cannot be read");
  if (!LooksLikeLog(path)) throw std::runtime_error("log " + path + " is not an LCM log");
  log_ = std::make_unique<lcm::LogFile>(path, "r");
  if (!log_->good()) throw std::runtime_error("log " + path + " cannot be read");
  while (ready_.empty() && ReadEvent()) {
  }
  if (ready_.empty()) throw std::runtime_error("log " + path + " holds no session of mapmend from its start on");
}

LogReader::~LogReader() = default;

std::optional<EncodedRecord> LogReader::Next() {
  while (ready_.empty() && !at_end_) {
    if (!ReadEvent()) {
      at_end_ = true;
      CloseIncomplete();
    }
  }
  if (ready_.empty()) return std::nullopt;
  EncodedRecord record = std::move(ready_.front());
  ready_.pop_front();
  return record;
}

bool LogReader::ReadEvent() {
  const lcm::LogEvent* event = log_->readNextEvent();
  if (event == nullptr) return false;
  const std::string channel = StreamChannel(event->channel);
  if (channel.empty()) return true;
  const auto* bytes = static_cast<const uint8_t*>(event->data);
  const DecodedRecord decoded = DecodeRecord(channel, bytes, event->datalen);
  if (!decoded.record) {
    if (num_refused_++ == 0) first_refusal_ = decoded.error;
    return true;
  }
  const RecordHeader& header = decoded.record->header;
  Session& session = sessions_[header.session];
  EncodedRecord encoded{header.session, header.seq, channel, std::vector<uint8_t>(bytes, bytes + event->datalen)};
  if (header.seq > session.next_seq) {
    session.early.emplace(header.seq, std::move(encoded));
  } else if (header.seq == session.next_seq) {
    Deliver(encoded, *decoded.record, &session);
    for (auto next = session.early.begin(); next != session.early.end() && next->first == session.next_seq;
         next = session.early.begin()) {
      const EncodedRecord early = std::move(next->second);
      session.early.erase(next);
      Deliver(early, *DecodeRecord(early.channel, early.data.data(), static_cast<int>(early.data.size())).record,
              &session);
    }
  }
  return true;
}

void LogReader::Deliver(const EncodedRecord& encoded, const Record& record, Session* session) {
  session->next_seq = encoded.seq + 1;
  session->last_utime = record.header.utime;
  if (const auto* started = std::get_if<SessionStarted>(&record.body)) {
    if (vocabulary_hash_.empty()) vocabulary_hash_ = started->vocabulary_hash;
  } else if (const auto* submap = std::get_if<SubmapStarted>(&record.body)) {
    session->open_submap = submap->submap;
  } else if (std::holds_alternative<SubmapEnded>(record.body)) {
    session->open_submap = SubmapId();
  } else if (std::holds_alternative<SessionEnded>(record.body)) {
    session->ended = true;
  } else if (const auto* keyframe = std::get_if<KeyframeRecord>(&record.body)) {
    session->last_frame = std::max(session->last_frame, keyframe->frame);
  } else if (const auto* update = std::get_if<MapUpdate>(&record.body)) {
    for (const TrackedFrame& frame : update->frames) session->last_frame = std::max(session->last_frame, frame.frame);
  }
  ready_.push_back(encoded);
}

void LogReader::CloseIncomplete() {
  for (auto& [id, session] : sessions_) {
    if (session.ended) continue;
    if (session.next_seq == 0) {
      complaints_.push_back("session " + id + ": its start is not in the log, so it cannot be mapped");
      continue;
    }
    complaints_.push_back("session " + id + " breaks off after record " + std::to_string(session.next_seq - 1) +
                          (session.early.empty()
                               ? ""
                               : ": the log lacks the next one, " + std::to_string(session.early.size()) +
                                     " later ones are of no use without it"));
    std::vector<RecordBody> closing;
    if (session.open_submap.IsValid()) {
      closing.push_back(SubmapEnded{session.open_submap, "end_of_input", "the recording ends here", session.last_frame,
                                    session.last_utime});
    }
    closing.push_back(SessionEnded{session.last_frame + 1});
    for (RecordBody& body : closing) {
      ready_.push_back(EncodeRecord(Record{{id, session.next_seq++, session.last_utime}, std::move(body)}));
    }
  }
  if (num_refused_ > 0) {
    complaints_.push_back(std::to_string(num_refused_) + " messages were refused; the first: " + first_refusal_);
  }
}

std::map<std::string, int64_t> LogReader::LastRecords() const {
  std::map<std::string, int64_t> last;
  for (const auto& [id, session] : sessions_) {
    if (session.next_seq > 0) last[id] = session.next_seq - 1;
  }
  return last;
}

}  // namespace mapmend
