#include <unistd.h>

#include <cstdio>
#include <filesystem>
#include <memory>
#include <stdexcept>

#include "procs/submap_store/database.h"
#include "procs/submap_store/db_commands.h"
#include "procs/submap_store/repair_source.h"
#include "procs/submap_store/revision_store.h"
#include "procs/submap_store/salvage.h"
#include "procs/submap_store/submap_store.h"

namespace mapmend {
namespace {

namespace fs = std::filesystem;

std::vector<std::string> ProblemsOf(const std::string& path) {
  try {
    return CheckDb(path);
  } catch (const std::exception& e) {
    return {e.what()};
  }
}

bool HasGaps(const std::string& path) {
  Database database(path, Database::Mode::kReadOnly);
  for (const SessionRow& session : database.Sessions()) {
    if (!database.Gaps(session.id).empty()) return true;
  }
  return false;
}

// The newest complete revision, if all of it is sound. Of a damaged file any step may fail.
bool CopyRevision(Database* from, Database* into) {
  try {
    RevisionStore stored(from), copy(into);
    RevisionRequest request;
    const RevisionAnswer newest = stored.Fetch(request);
    if (newest.status != RevisionAnswer::Status::kOk) return false;
    std::vector<std::vector<uint8_t>> parts;
    request.revision = newest.revision;
    for (request.part = 0; request.part < newest.num_parts; ++request.part) {
      RevisionAnswer part = stored.Fetch(request);
      if (part.status != RevisionAnswer::Status::kOk) return false;
      parts.push_back(std::move(part.data));
    }
    if (!copy.Store(newest.data.data(), static_cast<int>(newest.data.size()))) return false;
    for (const auto& part : parts) copy.StorePart(part.data(), static_cast<int>(part.size()));
    return true;
  } catch (const SQLite::Exception&) {
    return false;
  }
}

// A revision from a sound database that holds the same records.
bool TakeRevision(const std::string& path, Database* into, const std::string& stream) {
  if (!IsDatabase(path) || !ProblemsOf(path).empty() || HashDb(path).stream != stream) return false;
  Database other(path, Database::Mode::kReadOnly);
  return CopyRevision(&other, into);
}

void MakeDerivedRows(const std::string& path) {
  SubmapStoreOptions options;
  options.path = path;
  SubmapStore store(options);
  while (store.WorkInBackground()) continue;
}

std::string FreeName(const std::string& name) {
  for (int i = 2;; ++i) {
    const std::string candidate = i == 2 ? name : name + "-" + std::to_string(i - 1);
    if (!fs::exists(candidate)) return candidate;
  }
}

// The new file takes the name in one step; what was there, with its write-ahead log, has another name before.
std::string Replace(const std::string& path, const std::string& by) {
  const std::string kept = FreeName(path + ".damaged");
  std::error_code no_links;  // as on FAT
  fs::create_hard_link(path, kept, no_links);
  if (no_links) fs::copy_file(path, kept);
  for (const char* suffix : {"-wal", "-shm"}) {
    if (fs::exists(path + suffix)) fs::rename(path + suffix, kept + suffix);
  }
  fs::rename(by, path);
  return kept;
}

}  // namespace

void RemoveDb(const std::string& path) {
  for (const char* suffix : {"", "-wal", "-shm"}) fs::remove(path + suffix);
}

bool RepairDb(const std::string& path, std::vector<std::string> sources) {
  if (!fs::exists(path)) throw std::runtime_error(path + ": no such database");
  const std::vector<std::string> problems = ProblemsOf(path);
  for (const std::string& problem : problems) std::printf("%s\n", problem.c_str());
  if (sources.empty()) sources = FindRepairSources(fs::path(path).parent_path());
  if (problems.empty() && (sources.empty() || !HasGaps(path))) {
    std::printf("%s: sound, nothing to repair\n", path.c_str());
    return true;
  }
  const std::string temporary = path + ".part";
  RemoveDb(temporary);
  std::vector<std::string> lost;
  int64_t num_taken = 0;
  try {
    Database from(path, Database::Mode::kDamaged);
    std::unique_ptr<Database> into = std::make_unique<Database>(temporary, Database::Mode::kReadWrite);
    Salvage salvage(&from, into.get());
    salvage.TakeDatabase();
    for (const std::string& source : sources) {
      const int64_t taken = salvage.TakeSource(source);
      if (taken > 0) std::printf("%lld records from %s\n", static_cast<long long>(taken), source.c_str());
      num_taken += taken;
    }
    salvage.Finish(&lost);
    const bool is_as_it_was = lost.empty() && !salvage.HasFilledGap();
    bool has_map = is_as_it_was && CopyRevision(&from, into.get());
    into.reset();
    MakeDerivedRows(temporary);
    const std::string stream = HashDb(temporary).stream;
    into = std::make_unique<Database>(temporary, Database::Mode::kReadWrite);
    for (const std::string& source : sources) has_map = has_map || TakeRevision(source, into.get(), stream);
    if (!has_map) lost.push_back("the merged map is left out: `mapmend merge` makes it anew");
    into->Sql().exec("PRAGMA wal_checkpoint(TRUNCATE)");
  } catch (...) {
    RemoveDb(temporary);
    throw;
  }
  for (const std::string& line : lost) std::printf("%s\n", line.c_str());
  if (problems.empty() && num_taken == 0) {
    RemoveDb(temporary);
    std::printf("%s: sound; nothing fills its gaps\n", path.c_str());
    return true;
  }
  const std::string kept = Replace(path, temporary);
  std::printf("%s: repaired%s; as it was: %s\n", path.c_str(), lost.empty() ? "" : ", but for what is said above",
              kept.c_str());
  return lost.empty();
}

std::vector<std::string> CopyFlights(const std::string& path, const std::string& out) {
  RemoveDb(out);
  std::error_code error;
  if (!IsDatabase(path))
    throw std::runtime_error(path + (fs::file_size(path, error) == 0 ? ": is empty" : ": is not a map database"));
  try {
    // An older schema is brought up to date, and what a killed store left in the write-ahead log goes into the file.
    Database database(path, Database::Mode::kReadWrite);
    database.Sql().exec("PRAGMA wal_checkpoint(TRUNCATE)");
  } catch (const SQLite::Exception& e) {
    if (!IsDamage(e)) throw;
  }
  std::vector<std::string> problems = ProblemsOf(path);
  try {
    if (problems.empty()) {
      MergeDbs({path}, out);
      return problems;
    }
    Database from(path, Database::Mode::kDamaged);
    auto into = std::make_unique<Database>(out, Database::Mode::kReadWrite);
    Salvage salvage(&from, into.get());
    salvage.TakeDatabase();
    salvage.Finish(&problems);
    into.reset();
    MakeDerivedRows(out);
  } catch (...) {
    RemoveDb(out);
    throw;
  }
  return problems;
}

}  // namespace mapmend
