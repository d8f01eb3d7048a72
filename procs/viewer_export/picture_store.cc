#include "procs/viewer_export/picture_store.h"

#include <memory>
#include <utility>
#include <variant>

#include "libs/wire/codec.h"
#include "libs/wire/store_client.h"

namespace mapmend {
namespace {

constexpr int kTimeoutMs = 5000;

}  // namespace

PictureSource PicturesOf(StoreClient* store, std::function<void()> tick) {
  const auto is_silent = std::make_shared<bool>(false);
  PictureSource source;
  source.image = [store, tick, is_silent](const std::string& session,
                                          KeyframeId keyframe) -> std::optional<KeyframeImage> {
    if (tick) tick();
    if (*is_silent) return std::nullopt;
    auto answer = store->FetchImage(session, keyframe, kTimeoutMs);
    *is_silent = !answer;
    if (!answer || answer->status != ImageAnswer::Status::kOk) return std::nullopt;
    return std::move(answer->image);
  };
  source.keyframe = [store, tick](const std::string& session, int64_t seq) -> std::optional<KeyframeRecord> {
    if (tick) tick();
    const auto answer = store->Fetch({Addressed(), session, seq, seq, 1}, kTimeoutMs);
    if (!answer || answer->records.empty()) return std::nullopt;
    const EncodedRecord& encoded = answer->records.front();
    DecodedRecord decoded = DecodeRecord(encoded.channel, encoded.data.data(), static_cast<int>(encoded.data.size()));
    if (!decoded.record || !std::holds_alternative<KeyframeRecord>(decoded.record->body)) return std::nullopt;
    return std::get<KeyframeRecord>(std::move(decoded.record->body));
  };
  return source;
}

}  // namespace mapmend
