#include "procs/mapmend/map_file.h"

#include <stdlib.h>
#include <unistd.h>

#include <chrono>
#include <filesystem>
#include <mapmend/cursor_t.hpp>
#include <mapmend/fetch_t.hpp>
#include <mapmend/fetched_t.hpp>
#include <mapmend/revision_part_t.hpp>
#include <mapmend/revision_t.hpp>
#include <nlohmann/json.hpp>
#include <stdexcept>
#include <vector>

#include "libs/bus/store_client.h"
#include "libs/retrieval/vocabulary.h"
#include "procs/mapmend/finish_run.h"
#include "procs/mapmend/paths.h"
#include "procs/mapmend/session_rescue.h"

namespace mapmend {
namespace {

namespace fs = std::filesystem;

std::string MakeTemporaryFolder() {
  std::string path = (fs::temp_directory_path() / "mapmend-XXXXXX").string();
  if (mkdtemp(path.data()) == nullptr)
    throw std::runtime_error("cannot make a folder in " + fs::temp_directory_path().string());
  fs::create_directories(path + "/logs");
  return path;
}

}  // namespace

MapPlace FindMap(const std::string& path) {
  if (fs::is_directory(path)) {
    if (!fs::is_regular_file(path + "/map.db")) throw std::runtime_error(path + ": holds no map.db");
    return {path + "/map.db", path};
  }
  if (!fs::exists(path)) throw std::runtime_error(path + ": no such file or folder");
  return {path, ""};
}

MapFile::MapFile(const MapFileOptions& options) : options_(options) {
  if (options_.vocabulary.empty()) options_.vocabulary = DefaultVocabulary();
  if (options_.vocabulary.empty()) throw std::runtime_error("no vocabulary: give one with --vocabulary");
  BackendOptions backend;
  backend.db = options_.place.db;
  backend.vocabulary = options_.vocabulary;
  backend.vocabulary_hash = Vocabulary::Read(options_.vocabulary).Hash();
  backend.groundtruth = options_.groundtruth;
  backend.log_level = options_.log_level;
  backend.seed = options_.seed;
  backend.with_merger = options_.with_merger;
  backend.with_viewer = !options_.out.empty();
  if (options_.out.empty()) {
    temporary_ = MakeTemporaryFolder();
    backend.out = temporary_;
  } else {
    // Into the folder of the map itself, its exports are made anew; into another one, its map must not lie in the way.
    const bool is_own =
        fs::exists(options_.out) && fs::equivalent(fs::absolute(options_.place.db).parent_path(), options_.out);
    if (is_own && fs::exists(options_.out + "/summary.json")) {
      // What the run was told holds for exports that are made anew.
      const nlohmann::ordered_json earlier = ReadSummary(options_.out);
      title_ = earlier.value("title", "");
      const std::string groundtruth = earlier.value("groundtruth", "");
      if (options_.groundtruth.empty() && fs::is_regular_file(groundtruth)) backend.groundtruth = groundtruth;
    }
    out_folder_ = std::make_unique<OutFolder>(options_.out, false, is_own);
    backend.out = options_.out;
  }
  try {
    if (options_.forget_merged) {
      RunTool({"submap_store", "forget", options_.place.db}, backend.out + "/logs/forget.log", "cannot merge anew");
    }
    backend_ = std::make_unique<Backend>(backend);
  } catch (...) {
    if (!temporary_.empty()) fs::remove_all(temporary_);
    throw;
  }
}

MapFile::~MapFile() {
  backend_.reset();
  std::error_code ignored;
  if (!temporary_.empty()) fs::remove_all(temporary_, ignored);
}

std::string MapFile::Finish(const std::function<void(const std::string&)>& show) {
  const auto start = std::chrono::steady_clock::now();
  std::vector<std::pair<std::string, int64_t>> sessions;
  {
    StoreClient store(backend_->bus(), "map_file-" + std::to_string(getpid()));
    const auto reply = store.Fetch(fetch_t{});
    if (!reply) throw std::runtime_error(options_.place.db + ": the store does not answer");
    for (const cursor_t& cursor : reply->sessions) sessions.emplace_back(cursor.session, cursor.seq);
    if (sessions.empty()) throw std::runtime_error(options_.place.db + ": holds no flight");
    revision_t revision;
    std::vector<revision_part_t> parts;
    if (!options_.with_merger && (store.FetchRevision(-1, &revision, &parts) != StoreClient::RevisionStatus::kOk ||
                                  revision.transforms.is_final == 0)) {
      throw std::runtime_error(options_.place.db + ": holds no final merged map; `mapmend merge` makes one");
    }
  }
  if (options_.with_merger) {
    for (auto& [session, last] : sessions) last = RescueSession(backend_.get(), session, "").value_or(last);
  }
  for (const auto& [session, last] : sessions) {
    while (!backend_->IsFinished(session, last)) {
      const auto* merger = backend_->Health("merger");
      show(merger == nullptr || merger->message.empty() ? "reading the map" : merger->message);
      backend_->Tick(50);
    }
  }
  LauncherFigures figures;
  figures.title = title_;
  figures.readout_ms = FindCounter(backend_->Health("merger"), "readout_ms");
  figures.processes = backend_->StopAll();
  figures.wall_s = std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count();
  return options_.out.empty() ? "" : FinishRun(options_.out, figures, options_.place.db);
}

}  // namespace mapmend
