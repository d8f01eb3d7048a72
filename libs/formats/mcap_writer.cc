#include "libs/formats/mcap_writer.h"

#include <algorithm>
#include <utility>

#include "libs/base/checksum.h"
#include "libs/formats/little_endian.h"

namespace mapmend {
namespace {

constexpr char kMagic[] = "\x89MCAP0\r\n";
constexpr size_t kChunkSize = 4 << 20;  // bytes from which a chunk is written

enum class Op : uint8_t {
  kHeader = 1,
  kFooter,
  kSchema,
  kChannel,
  kMessage,
  kChunk,
  kMessageIndex,
  kChunkIndex,
  kStatistics = 0x0b,
  kSummaryOffset = 0x0e,
  kDataEnd = 0x0f
};

std::string MakeRecord(Op op, const std::string& content) {
  std::string record;
  Append(static_cast<uint8_t>(op), &record);
  Append(static_cast<uint64_t>(content.size()), &record);
  return record + content;
}

void AppendText(std::string_view text, std::string* bytes) {
  Append(static_cast<uint32_t>(text.size()), bytes);
  *bytes += text;
}

uint32_t Crc(const std::string& bytes) { return Crc32(bytes.data(), bytes.size()); }

}  // namespace

McapWriter::McapWriter(std::ostream* stream) : stream_(stream) {
  std::string header;
  AppendText("", &header);
  AppendText("mapmend " MAPMEND_VERSION, &header);
  Write(std::string(kMagic, 8) + MakeRecord(Op::kHeader, header));
}

void McapWriter::Write(const std::string& bytes) {
  stream_->write(bytes.data(), static_cast<std::streamsize>(bytes.size()));
  size_ += bytes.size();
}

std::string McapWriter::SchemaRecord(uint16_t id) const {
  const auto& [name, text] = schemas_[id - 1];
  std::string content;
  Append(id, &content);
  AppendText(name, &content);
  AppendText("jsonschema", &content);
  AppendText(text, &content);
  return MakeRecord(Op::kSchema, content);
}

std::string McapWriter::ChannelRecord(uint16_t id) const {
  std::string content;
  Append(id, &content);
  Append(channels_[id].schema, &content);
  AppendText(channels_[id].topic, &content);
  AppendText("json", &content);
  Append(uint32_t{0}, &content);  // no metadata
  return MakeRecord(Op::kChannel, content);
}

uint16_t McapWriter::AddChannel(const std::string& topic, const std::string& schema_name, const std::string& schema) {
  auto it =
      std::find_if(schemas_.begin(), schemas_.end(), [&](const auto& known) { return known.first == schema_name; });
  if (it == schemas_.end()) {
    it = schemas_.insert(it, {schema_name, schema});
    chunk_.records += SchemaRecord(static_cast<uint16_t>(schemas_.size()));
  }
  Channel channel;
  channel.schema = static_cast<uint16_t>(it - schemas_.begin() + 1);
  channel.topic = topic;
  channels_.push_back(channel);
  const auto id = static_cast<uint16_t>(channels_.size() - 1);
  chunk_.records += ChannelRecord(id);
  return id;
}

void McapWriter::AddMessage(uint16_t channel, uint64_t time, std::string_view json) {
  if (chunk_.index.empty()) chunk_.first_time = chunk_.last_time = time;
  chunk_.first_time = std::min(chunk_.first_time, time);
  chunk_.last_time = std::max(chunk_.last_time, time);
  chunk_.index[channel].emplace_back(time, chunk_.records.size());
  std::string content;
  Append(channel, &content);
  Append(static_cast<uint32_t>(channels_[channel].num_messages++), &content);
  Append(time, &content);
  Append(time, &content);
  content += json;
  chunk_.records += MakeRecord(Op::kMessage, content);
  if (chunk_.records.size() >= kChunkSize) FinishChunk();
}

void McapWriter::FinishChunk() {
  if (chunk_.index.empty()) return;
  ChunkPlace place;
  place.first_time = chunk_.first_time;
  place.last_time = chunk_.last_time;
  place.start = size_;
  place.size = chunk_.records.size();
  std::string content;
  Append(place.first_time, &content);
  Append(place.last_time, &content);
  Append(place.size, &content);
  Append(Crc(chunk_.records), &content);
  AppendText("", &content);  // no compression
  Append(place.size, &content);
  Write(MakeRecord(Op::kChunk, content + chunk_.records));
  place.length = size_ - place.start;
  for (const auto& [channel, messages] : chunk_.index) {
    place.index_starts[channel] = size_;
    std::string index;
    Append(channel, &index);
    Append(static_cast<uint32_t>(16 * messages.size()), &index);
    for (const auto& [time, offset] : messages) {
      Append(time, &index);
      Append(offset, &index);
    }
    Write(MakeRecord(Op::kMessageIndex, index));
  }
  place.index_length = size_ - place.start - place.length;
  places_.push_back(std::move(place));
  chunk_ = Chunk();
}

std::string McapWriter::PlaceRecord(const ChunkPlace& place) {
  std::string content;
  Append(place.first_time, &content);
  Append(place.last_time, &content);
  Append(place.start, &content);
  Append(place.length, &content);
  Append(static_cast<uint32_t>(10 * place.index_starts.size()), &content);
  for (const auto& [channel, start] : place.index_starts) {
    Append(channel, &content);
    Append(start, &content);
  }
  Append(place.index_length, &content);
  AppendText("", &content);
  Append(place.size, &content);
  Append(place.size, &content);
  return MakeRecord(Op::kChunkIndex, content);
}

std::string McapWriter::Statistics() const {
  uint64_t count = 0, first = 0, last = 0;
  for (const Channel& channel : channels_) count += channel.num_messages;
  if (!places_.empty()) first = places_.front().first_time;
  for (const ChunkPlace& place : places_) {
    first = std::min(first, place.first_time);
    last = std::max(last, place.last_time);
  }
  std::string content;
  Append(count, &content);
  Append(static_cast<uint16_t>(schemas_.size()), &content);
  Append(static_cast<uint32_t>(channels_.size()), &content);
  Append(uint32_t{0}, &content);  // attachments
  Append(uint32_t{0}, &content);  // metadata
  Append(static_cast<uint32_t>(places_.size()), &content);
  Append(first, &content);
  Append(last, &content);
  Append(static_cast<uint32_t>(10 * channels_.size()), &content);
  for (size_t i = 0; i < channels_.size(); ++i) {
    Append(static_cast<uint16_t>(i), &content);
    Append(channels_[i].num_messages, &content);
  }
  return MakeRecord(Op::kStatistics, content);
}

void McapWriter::Finish() {
  FinishChunk();
  std::string end;
  Append(uint32_t{0}, &end);  // no checksum over all; each chunk has its own
  Write(MakeRecord(Op::kDataEnd, end));
  const uint64_t summary_start = size_;
  std::string summary, offsets;
  const auto add_group = [&](Op op, const std::string& group) {
    if (group.empty()) return;
    std::string content;
    Append(static_cast<uint8_t>(op), &content);
    Append(static_cast<uint64_t>(summary_start + summary.size()), &content);
    Append(static_cast<uint64_t>(group.size()), &content);
    offsets += MakeRecord(Op::kSummaryOffset, content);
    summary += group;
  };
  std::string schemas, channels, places;
  for (size_t i = 0; i < schemas_.size(); ++i) schemas += SchemaRecord(static_cast<uint16_t>(i + 1));
  for (size_t i = 0; i < channels_.size(); ++i) channels += ChannelRecord(static_cast<uint16_t>(i));
  for (const ChunkPlace& place : places_) places += PlaceRecord(place);
  add_group(Op::kSchema, schemas);
  add_group(Op::kChannel, channels);
  add_group(Op::kStatistics, Statistics());
  add_group(Op::kChunkIndex, places);
  std::string footer;
  Append(static_cast<uint8_t>(Op::kFooter), &footer);
  Append(uint64_t{20}, &footer);
  Append(summary_start, &footer);
  Append(static_cast<uint64_t>(summary_start + summary.size()), &footer);
  const std::string covered = summary + offsets + footer;  // by the checksum: all of the summary up to it
  footer.clear();
  Append(Crc(covered), &footer);
  Write(covered + footer + std::string(kMagic, 8));
}

}  // namespace mapmend
