#include "procs/submap_store/submap_tracker.h"

#include "procs/submap_store/submap_model.h"

namespace mapmend {

SubmapTracker::SubmapTracker(Database* database, const SessionRow& session, SubmapId submap, int64_t start_seq)
    : database_(database), session_(session), submap_(submap), start_seq_(start_seq), seq_(start_seq - 1) {}

const Submap& SubmapTracker::AsOf(int64_t seq) {
  if (seq < seq_) {
    model_ = Session();
    seq_ = start_seq_ - 1;
  }
  if (seq == seq_) return model_.submaps[submap_];
  database_->ReadRecords(session_, seq_ + 1, seq, [&](const EncodedRecord& encoded) {
    const DecodedRecord decoded =
        DecodeRecord(encoded.channel, encoded.data.data(), static_cast<int>(encoded.data.size()));
    if (decoded.record && SubmapOf(decoded.record->body) == submap_) ApplyLight(*decoded.record, &model_);
    return true;
  });
  seq_ = std::max(seq_, seq);
  return model_.submaps[submap_];
}

}  // namespace mapmend
