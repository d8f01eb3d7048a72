#pragma once

#include <cstdint>
#include <map>

#include "libs/base/checksum.h"
#include "libs/stream/records.h"
#include "libs/stream/stream_messages.h"
#include "libs/wire/stream_codec.h"

namespace mapmend {

namespace channels {
inline constexpr char kChecksum[] = "MAPMEND_CHECKSUM";
}

// Makes what goes out on MAPMEND_CHECKSUM before each record of a session: a recording then tells damage.
class RecordChecksums {
 public:
  // With the checksums of up to kRepeated records, this one the last. Each is so repeated that damage to one message
  // does not matter.
  RecordChecksumList Of(const EncodedRecord& record) {
    known_[record.seq] = RecordChecksum(record.channel, record.data.data(), record.data.size());
    while (known_.begin()->first < record.seq - kKept) known_.erase(known_.begin());
    RecordChecksumList message{record.session, record.seq, {}};
    for (int i = 1; i < kRepeated && known_.contains(message.first_seq - 1); ++i) --message.first_seq;
    for (auto it = known_.find(message.first_seq); it != known_.end() && it->first <= record.seq; ++it)
      message.crc32.push_back(it->second);
    return message;
  }

 private:
  static constexpr int kRepeated = 8;
  static constexpr int64_t kKept = 1024;  // records that may be sent again
  std::map<int64_t, uint32_t> known_;
};

}  // namespace mapmend
