#pragma once

#include <cstdint>
#include <map>
#include <ostream>
#include <string>
#include <string_view>
#include <vector>

namespace mapmend {

// Writes an MCAP container (https://mcap.dev/spec, version 0) of messages with JSON schemas: chunks without
// compression, an index of each, and a summary, so that players can seek. The stream is written from front to back,
// never moved back in. What fails is for the stream to tell.
class McapWriter {
 public:
  explicit McapWriter(std::ostream* stream);

  // A channel whose messages are JSON. schema: a JSON schema; channels whose schemas have the same name share one.
  // Returns the channel's number.
  uint16_t AddChannel(const std::string& topic, const std::string& schema_name, const std::string& schema);
  // Times in ns. Best in the order of time; players read others as well.
  void AddMessage(uint16_t channel, uint64_t time, std::string_view json);
  // Nothing may be added afterwards.
  void Finish();

 private:
  struct Channel {
    uint16_t schema = 0;
    std::string topic;
    uint64_t num_messages = 0;
  };
  struct Chunk {
    std::string records;
    uint64_t first_time = 0, last_time = 0;
    std::map<uint16_t, std::vector<std::pair<uint64_t, uint64_t>>> index;  // by channel: time, offset
  };
  struct ChunkPlace {
    uint64_t first_time = 0, last_time = 0, start = 0, length = 0, size = 0, index_length = 0;
    std::map<uint16_t, uint64_t> index_starts;  // by channel
  };

  void Write(const std::string& bytes);
  void FinishChunk();
  std::string SchemaRecord(uint16_t id) const;
  std::string ChannelRecord(uint16_t id) const;
  static std::string PlaceRecord(const ChunkPlace& place);
  std::string Statistics() const;

  std::ostream* stream_;
  uint64_t size_ = 0;                                         // written
  std::vector<std::pair<std::string, std::string>> schemas_;  // name, text; number 1 is the first
  std::vector<Channel> channels_;                             // number 0 is the first
  Chunk chunk_;
  std::vector<ChunkPlace> places_;
};

}  // namespace mapmend
