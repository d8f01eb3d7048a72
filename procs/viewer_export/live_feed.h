#pragma once

#include <cstdint>
#include <deque>
#include <map>
#include <mutex>
#include <nlohmann/json_fwd.hpp>
#include <set>
#include <string>
#include <string_view>
#include <unordered_map>
#include <vector>

namespace mapmend {

// Compact; bytes that are not UTF-8 are replaced.
std::string JsonText(const nlohmann::json& json);

// What the live page is told: named values, and tables of rows of bytes. Each of them has the number of its last
// change, so that a page that has seen all changes up to some number needs only what has changed since: what it gets
// does not depend on how often it asks, and one that asks seldom gets each thing once, in its newest form. Thread-safe.
//
// A page sees {"epoch", "from", "to", "set": {name: value}, "gone": [name], "rows": {table: base64}}. A table's rows
// are little-endian: the row's number (uint32), then its bytes, all rows of a table equally long (docs/live_page.md).
class LiveFeed {
 public:
  LiveFeed();
  LiveFeed(const LiveFeed&) = delete;
  LiveFeed& operator=(const LiveFeed&) = delete;

  // A value as JSON text; an equal one is no change.
  void Set(const std::string& name, const std::string& json);
  // Forgets a value; none of that name is no change.
  void Erase(const std::string& name);
  // Forgets the values whose names begin so, but for these.
  void KeepOnly(const std::string& prefix, const std::set<std::string>& names);
  // Rows may come in any order. An equal one is no change. Throws std::logic_error if the rows of a table differ in
  // size.
  void SetRow(const std::string& table, uint32_t row, std::string_view bytes);

  // Number of the last change, 0 before any.
  int64_t Version() const;
  // Tells one run of a viewer from the next: versions of another epoch say nothing here.
  const std::string& Epoch() const { return epoch_; }

  struct Message {
    std::string json;
    int64_t version = 0;  // the page is up to date as far as this
  };
  // The changes after `version`, oldest first, until the message has about max_bytes. Empty json: there are none. A
  // version from the future counts as 0.
  Message Since(int64_t version, size_t max_bytes) const;
  // All values as one JSON object, without the tables.
  std::string Values() const;

 private:
  struct Value {
    std::string json;  // empty: it is gone
    int64_t version = 0;
  };
  struct Table {
    std::string name;
    size_t row_size = 0;
    std::string bytes;              // row by row
    std::vector<int64_t> versions;  // of each row; 0: never set
  };
  // One change; it is stale if what it names has changed again since.
  struct Change {
    int64_t version = 0;
    int32_t table = -1;  // -1: a value
    uint32_t row = 0;    // or index into names_
  };
  static constexpr size_t kStaleFloor = 1024;  // stale changes below this number are left where they are

  void Add(int32_t table, uint32_t row);
  void Forget(uint32_t value);
  bool IsStale(const Change& change) const;
  void DropStale();

  const std::string epoch_;
  mutable std::mutex mutex_;
  // Guarded by mutex_.
  int64_t version_ = 0;
  std::deque<std::string> names_;
  std::vector<Value> values_;
  std::unordered_map<std::string, uint32_t> value_index_;
  std::vector<Table> tables_;
  std::unordered_map<std::string, int32_t> table_index_;
  std::vector<Change> changes_;  // ascending
  size_t num_live_ = 0;          // things that have a version
};

}  // namespace mapmend
