#pragma once

#include <cstdint>
#include <map>
#include <mapmend/record_checksum_t.hpp>

#include "libs/base/checksum.h"
#include "libs/wire/codec.h"

namespace mapmend {

namespace channels {
inline constexpr char kChecksum[] = "MAPMEND_CHECKSUM";
}

// Makes what goes out on MAPMEND_CHECKSUM before each record of a session: a recording then tells damage.
class RecordChecksums {
 public:
  // With the checksums of up to kRepeated records, this one the last. Each is so repeated that damage to one message
  // does not matter.
  record_checksum_t Of(const EncodedRecord& record) {
    known_[record.seq] = RecordChecksum(record.channel, record.data.data(), record.data.size());
    while (known_.begin()->first < record.seq - kKept) known_.erase(known_.begin());
    record_checksum_t message{};
    message.session = record.session;
    message.first_seq = record.seq;
    for (int i = 1; i < kRepeated && known_.contains(message.first_seq - 1); ++i) --message.first_seq;
    for (auto it = known_.find(message.first_seq); it != known_.end() && it->first <= record.seq; ++it)
      message.crc32.push_back(static_cast<int32_t>(it->second));
    message.num_records = static_cast<int32_t>(message.crc32.size());
    return message;
  }

 private:
  static constexpr int kRepeated = 8;
  static constexpr int64_t kKept = 1024;  // records that may be sent again
  std::map<int64_t, uint32_t> known_;
};

}  // namespace mapmend
