#include "procs/mapmend/map_rescue.h"

#include <SQLiteCpp/SQLiteCpp.h>
#include <unistd.h>

#include <algorithm>
#include <filesystem>
#include <map>
#include <stdexcept>
#include <vector>

#include "libs/retrieval/vocabulary.h"
#include "libs/wire/store_client.h"
#include "procs/mapmend/paths.h"
#include "procs/mapmend/session_rescue.h"

namespace mapmend {
namespace {

namespace fs = std::filesystem;

class TemporaryLogs {
 public:
  TemporaryLogs() : path_((fs::temp_directory_path() / "mapmend-XXXXXX").string()) {
    if (mkdtemp(path_.data()) == nullptr)
      throw std::runtime_error("cannot make a folder in " + fs::temp_directory_path().string());
    fs::create_directories(path_ + "/logs");
  }
  ~TemporaryLogs() {
    std::error_code ignored;
    fs::remove_all(path_, ignored);
  }
  const std::string& Path() const { return path_; }

 private:
  std::string path_;
};

// What cannot be read is left to those who say why.
bool HasOpenSession(const std::string& db) {
  if (!fs::exists(db)) return false;
  try {
    SQLite::Database database(db, SQLite::OPEN_READONLY);
    return database.execAndGet("SELECT EXISTS(SELECT 1 FROM session WHERE ended = 0)").getInt() != 0;
  } catch (const SQLite::Exception&) {
    return false;
  }
}

bool IsMerged(Backend* backend) {
  StoreClient store(backend->bus(), "map_rescue-" + std::to_string(getpid()));
  const MergedTransforms transforms = store.FetchRevision(-1).revision.transforms;  // not final: there is none
  if (!transforms.is_final) return false;
  std::map<std::string, int64_t> merged;
  for (const StreamCursor& cursor : transforms.cursors) merged[cursor.session] = cursor.seq;
  const auto sessions = ListSessions(backend->bus());
  return std::all_of(sessions.begin(), sessions.end(), [&](const auto& session) {
    const auto found = merged.find(session.id);
    return found != merged.end() && found->second >= session.last_seq;
  });
}

}  // namespace

MapRescue RescueMap(const MapFileOptions& options, bool always, const std::function<void(const std::string&)>& tell) {
  // A database named map.db lies in its folder of results.
  const fs::path db = options.place.db;
  const std::string folder = db.filename() == "map.db" ? fs::absolute(db).parent_path().string() : "";
  const bool waits = !folder.empty() && HoldsUndelivered(folder);
  if (!always && !waits && !HasOpenSession(options.place.db)) return {};
  const TemporaryLogs logs;
  BackendOptions backend_options;
  backend_options.db = options.place.db;
  backend_options.out = logs.Path();
  backend_options.vocabulary = options.vocabulary.empty() ? DefaultVocabulary() : options.vocabulary;
  if (backend_options.vocabulary.empty()) throw std::runtime_error("no vocabulary: give one with --vocabulary");
  backend_options.vocabulary_hash = Vocabulary::Read(backend_options.vocabulary).Hash();
  backend_options.log_level = options.log_level;
  backend_options.settings = options.settings;
  backend_options.with_merger = backend_options.with_viewer = false;
  backend_options.tell = tell;
  Backend backend(backend_options);
  const RescueReport report = folder.empty() ? CloseSessions(&backend) : RescueFolder(&backend, folder);
  for (const std::string& line : report.lines) tell(line);
  if (ListSessions(backend.bus()).empty()) throw std::runtime_error(options.place.db + ": holds no flight");
  return {report.changed, always && !report.changed && IsMerged(&backend)};
}

}  // namespace mapmend
