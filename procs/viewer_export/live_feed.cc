#include "procs/viewer_export/live_feed.h"

#include <algorithm>
#include <nlohmann/json.hpp>
#include <random>
#include <stdexcept>

#include "libs/formats/base64.h"

namespace mapmend {
namespace {

std::string NewEpoch() {
  std::random_device random;
  static constexpr char kDigits[] = "0123456789abcdef";
  std::string epoch;
  for (int i = 0; i < 16; ++i) epoch += kDigits[random() % 16];
  return epoch;
}

std::string Quoted(const std::string& text) {
  return nlohmann::json(text).dump(-1, ' ', false, nlohmann::json::error_handler_t::replace);
}

// "name": value, ... with a comma before all but the first.
void AppendMember(const std::string& name, const std::string& json, std::string* members) {
  if (!members->empty()) *members += ',';
  members->append(Quoted(name)).append(":").append(json);
}

void AppendNumber(uint32_t number, std::string* bytes) {
  for (int shift = 0; shift < 32; shift += 8) *bytes += static_cast<char>(number >> shift & 0xff);
}

}  // namespace

std::string JsonText(const nlohmann::json& json) {
  return json.dump(-1, ' ', false, nlohmann::json::error_handler_t::replace);
}

LiveFeed::LiveFeed() : epoch_(NewEpoch()) {}

void LiveFeed::Add(int32_t table, uint32_t row) {
  changes_.push_back({version_, table, row});
  if (changes_.size() > kStaleFloor + 2 * num_live_) DropStale();
}

bool LiveFeed::IsStale(const Change& change) const {
  const int64_t newest =
      change.table < 0 ? values_[change.row].version : tables_[static_cast<size_t>(change.table)].versions[change.row];
  return newest != change.version;
}

void LiveFeed::DropStale() {
  changes_.erase(
      std::remove_if(changes_.begin(), changes_.end(), [this](const Change& change) { return IsStale(change); }),
      changes_.end());
}

void LiveFeed::Set(const std::string& name, const std::string& json) {
  const std::lock_guard lock(mutex_);
  const auto [it, is_new] = value_index_.try_emplace(name, static_cast<uint32_t>(values_.size()));
  if (is_new) {
    names_.push_back(name);
    values_.emplace_back();
    ++num_live_;
  }
  Value& value = values_[it->second];
  if (value.json == json) return;
  value = {json, ++version_};
  Add(-1, it->second);
}

void LiveFeed::Forget(uint32_t value) {
  if (values_[value].json.empty()) return;
  values_[value] = {"", ++version_};
  Add(-1, value);
}

void LiveFeed::Erase(const std::string& name) {
  const std::lock_guard lock(mutex_);
  if (const auto it = value_index_.find(name); it != value_index_.end()) Forget(it->second);
}

void LiveFeed::KeepOnly(const std::string& prefix, const std::set<std::string>& names) {
  const std::lock_guard lock(mutex_);
  for (size_t i = 0; i < names_.size(); ++i) {
    if (names_[i].starts_with(prefix) && !names.contains(names_[i])) Forget(static_cast<uint32_t>(i));
  }
}

void LiveFeed::SetRow(const std::string& table_name, uint32_t row, std::string_view bytes) {
  const std::lock_guard lock(mutex_);
  const auto [it, is_new] = table_index_.try_emplace(table_name, static_cast<int32_t>(tables_.size()));
  if (is_new) tables_.push_back({table_name, bytes.size(), "", {}});
  Table& table = tables_[static_cast<size_t>(it->second)];
  if (table.row_size != bytes.size()) throw std::logic_error("rows of different sizes in " + table_name);
  if (row >= table.versions.size()) {
    table.versions.resize(row + 1, 0);
    table.bytes.resize(table.versions.size() * table.row_size);
  }
  char* at = table.bytes.data() + row * table.row_size;
  int64_t& version = table.versions[row];
  if (version > 0 && std::equal(bytes.begin(), bytes.end(), at)) return;
  std::copy(bytes.begin(), bytes.end(), at);
  if (version == 0) ++num_live_;
  version = ++version_;
  Add(it->second, row);
}

int64_t LiveFeed::Version() const {
  const std::lock_guard lock(mutex_);
  return version_;
}

LiveFeed::Message LiveFeed::Since(int64_t version, size_t max_bytes) const {
  const std::lock_guard lock(mutex_);
  if (version < 0 || version > version_) version = 0;
  std::string set, gone;
  std::map<int32_t, std::string> rows;
  size_t size = 0;
  Message message;
  message.version = version_;
  auto change = std::upper_bound(changes_.begin(), changes_.end(), version,
                                 [](int64_t v, const Change& c) { return v < c.version; });
  for (; change != changes_.end(); ++change) {
    if (IsStale(*change)) continue;
    if (size >= max_bytes) {
      message.version = change->version - 1;
      break;
    }
    if (change->table >= 0) {
      const Table& table = tables_[static_cast<size_t>(change->table)];
      std::string& bytes = rows[change->table];
      AppendNumber(change->row, &bytes);
      bytes.append(table.bytes, change->row * table.row_size, table.row_size);
      size += (table.row_size + sizeof(uint32_t)) * 4 / 3;
    } else if (const std::string& json = values_[change->row].json; json.empty()) {
      if (!gone.empty()) gone += ',';
      gone += Quoted(names_[change->row]);
      size += names_[change->row].size();
    } else {
      AppendMember(names_[change->row], json, &set);
      size += json.size();
    }
  }
  if (message.version == version) return message;
  std::string tables;
  for (const auto& [table, bytes] : rows) {
    std::string text = "\"";
    text.append(Base64(bytes)).append("\"");
    AppendMember(tables_[static_cast<size_t>(table)].name, text, &tables);
  }
  message.json.append("{\"epoch\":\"").append(epoch_);
  message.json.append("\",\"from\":").append(std::to_string(version));
  message.json.append(",\"to\":").append(std::to_string(message.version));
  message.json.append(",\"newest\":").append(std::to_string(version_));
  message.json.append(",\"set\":{").append(set).append("},\"gone\":[").append(gone);
  message.json.append("],\"rows\":{").append(tables).append("}}");
  return message;
}

std::string LiveFeed::Values() const {
  const std::lock_guard lock(mutex_);
  std::string members, object = "{";
  for (size_t i = 0; i < values_.size(); ++i) {
    if (!values_[i].json.empty()) AppendMember(names_[i], values_[i].json, &members);
  }
  return object.append(members).append("}");
}

}  // namespace mapmend
