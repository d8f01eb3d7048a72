#include "procs/mapmend/map_file.h"

#include <signal.h>
#include <stdlib.h>
#include <unistd.h>

#include <CLI/CLI.hpp>
#include <cerrno>
#include <chrono>
#include <cstdio>
#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <nlohmann/json.hpp>
#include <set>
#include <stdexcept>
#include <vector>

#include "libs/bus/process.h"
#include "libs/images/image_file.h"
#include "libs/retrieval/vocabulary.h"
#include "libs/wire/store_client.h"
#include "procs/mapmend/finish_run.h"
#include "procs/mapmend/image_delivery.h"
#include "procs/mapmend/map_rescue.h"
#include "procs/mapmend/paths.h"
#include "procs/mapmend/run_flight.h"
#include "procs/mapmend/run_tool.h"
#include "procs/mapmend/session_rescue.h"

namespace mapmend {
namespace {

namespace fs = std::filesystem;

constexpr char kUnfinished[] = ".merging";  // in names of what is not complete yet

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
    if (!fs::is_regular_file(path + "/map.db") && !HoldsUndelivered(path))
      throw std::runtime_error(path + ": holds no map.db");
    return {path + "/map.db", path};
  }
  if (!fs::exists(path)) throw std::runtime_error(path + ": no such file or folder");
  if (fs::is_regular_file(path) && fs::file_size(path) == 0) throw std::runtime_error(path + ": is empty");
  return {path, ""};
}

MapFile::MapFile(const MapFileOptions& options) : options_(options) {
  if (options_.vocabulary.empty()) options_.vocabulary = DefaultVocabulary();
  if (options_.vocabulary.empty()) throw std::runtime_error("no vocabulary: give one with --vocabulary");
  // What a power cut has left is put in order first, on the map itself; then the merged map must be made anew.
  const auto tell = [](const std::string& line) { std::fprintf(stderr, "%s\n", line.c_str()); };
  if (RescueMap(options_, false, tell).changed && !options_.with_merger) {
    MapFileOptions anew = options_;
    anew.with_merger = true;
    MapFile(anew).Finish([](const std::string&) {});
  }
  BackendOptions backend;
  backend.db = options_.place.db;
  backend.images = ImagePathFor(options_.place.db);  // also of a copy
  backend.vocabulary = options_.vocabulary;
  backend.vocabulary_hash = Vocabulary::Read(options_.vocabulary).Hash();
  backend.groundtruth = options_.groundtruth;
  backend.log_level = options_.log_level;
  backend.seed = options_.seed;
  backend.settings = options_.settings;
  backend.with_merger = options_.with_merger;
  backend.with_viewer = !options_.out.empty() || options_.page_port > 0;
  backend.port = options_.page_port;
  backend.bind = options_.page_bind;
  backend.page_is_stored = options_.page_port > 0;
  backend.page_files = options_.page_port > 0 ? options_.place.folder : "";
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
    options_.exports = options_.exports.WithEarlier(options_.out);
    backend.export_arguments = options_.exports.Arguments();
    backend.with_mosaic = options_.with_merger && options_.exports.DrawsLive();
  }
  backend.logs = backend.out + "/logs";
  try {
    if (options_.with_merger) {
      CopyFlights(backend.logs);
      backend.db = copy_;
      if (!options_.out.empty()) {
        exports_ = options_.out + "/" + kUnfinished;
        fs::remove_all(exports_);
        fs::create_directory(exports_);
        backend.out = exports_;
      }
    }
    backend_ = std::make_unique<Backend>(backend);
  } catch (...) {
    RemoveUnfinished();
    throw;
  }
}

MapFile::~MapFile() {
  backend_.reset();
  RemoveUnfinished();
}

void MapFile::RemoveUnfinished() {
  std::error_code ignored;
  for (const char* suffix : {"", "-wal", "-shm", ".part"}) {
    if (!copy_.empty()) fs::remove(copy_ + suffix, ignored);
  }
  for (const std::string& folder : {exports_, temporary_}) {
    if (!folder.empty()) fs::remove_all(folder, ignored);
  }
}

void MapFile::CopyFlights(const std::string& logs) {
  const fs::path db(options_.place.db);
  const std::string stem = db.filename().string() + kUnfinished + "-";
  for (const auto& entry : fs::directory_iterator(fs::absolute(db).parent_path())) {
    // Of a process that was killed.
    const std::string name = entry.path().filename().string();
    if (!name.starts_with(stem)) continue;
    const int pid = std::atoi(name.c_str() + stem.size());
    std::error_code ignored;
    if (pid > 0 && kill(pid, 0) != 0 && errno == ESRCH) fs::remove(entry.path(), ignored);
  }
  copy_ = options_.place.db + kUnfinished + "-" + std::to_string(getpid());
  const std::string log = logs + "/copy.log";
  fs::remove(log);
  const ExitStatus status = RunToEnd({"submap_store", "copy-flights", options_.place.db, copy_}, log, [] {
    if (StopRequested()) throw Interrupted();
  });
  if (status.Success()) return;
  if (status.signal != 0 || status.code != kExitInputCutShort)
    throw std::runtime_error("cannot merge anew: " + DescribeFailure("submap_store", status, log, 0));
  std::ifstream lines(log);
  for (std::string line; std::getline(lines, line);) {
    if (line.find("session ") == 0 || line.find(options_.place.db) == 0 || line.find("decision") == 0 ||
        line.find("merged map") == 0)
      problems_.push_back(line);
  }
  if (problems_.empty()) problems_.push_back(options_.place.db + ": is damaged; `mapmend db check` says how");
}

// First the exports, then the map: it is what they are made from.
void MapFile::TakeOver() {
  if (!exports_.empty()) {
    // What SQLite may have left beside the file of tiles belongs to the one that goes.
    std::error_code ignored;
    for (const char* suffix : {"-wal", "-shm"}) fs::remove(options_.out + "/mosaic.mbtiles" + suffix, ignored);
    // A picture of the map as it was would be taken for one of the map as it is.
    if (!options_.exports.DrawsLive()) fs::remove(options_.out + "/mosaic.mbtiles", ignored);
    for (const std::string& name : PictureFiles()) {
      if (options_.exports.DrawsNothing()) fs::remove(options_.out + "/" + name, ignored);
    }
    for (const auto& entry : fs::directory_iterator(exports_)) {
      const fs::path target = fs::path(options_.out) / entry.path().filename();
      if (entry.is_directory()) fs::remove_all(target);
      fs::rename(entry.path(), target);
    }
  }
  if (fs::exists(copy_ + "-wal") && fs::file_size(copy_ + "-wal") > 0) {
    // Its store was killed at the end.
    RunTool({"submap_store", "compact", copy_}, (options_.out.empty() ? temporary_ : options_.out) + "/logs/copy.log",
            "cannot finish the map");
  }
  if (!problems_.empty()) {
    const std::string kept = options_.place.db + ".damaged";
    std::error_code no_links;  // as on FAT
    if (!fs::exists(kept)) fs::create_hard_link(options_.place.db, kept, no_links);
    if (no_links) fs::copy_file(options_.place.db, kept);
  }
  fs::rename(copy_, options_.place.db);
}

std::string MapFile::Finish(const std::function<void(const std::string&)>& show) {
  const auto start = std::chrono::steady_clock::now();
  std::vector<std::pair<std::string, int64_t>> sessions;
  {
    StoreClient store(backend_->bus(), "map_file-" + std::to_string(getpid()));
    const auto reply = store.Fetch(FetchRequest{});
    if (!reply) throw std::runtime_error(options_.place.db + ": the store does not answer");
    for (const StreamCursor& cursor : reply->sessions) sessions.emplace_back(cursor.session, cursor.seq);
    if (sessions.empty()) throw std::runtime_error(options_.place.db + ": holds no flight");
    if (!options_.with_merger && !store.FetchRevision(-1).revision.transforms.is_final) {
      throw std::runtime_error(options_.place.db + ": holds no final merged map; `mapmend merge` makes one");
    }
  }
  if (options_.with_merger) {
    for (auto& [session, last] : sessions) last = RescueSession(backend_.get(), session).value_or(last);
  }
  std::set<std::string> names;
  for (const auto& [session, last] : sessions) names.insert(session);
  const std::string spool = options_.place.folder.empty() ? "" : SpoolPathFor(options_.place.folder + "/outbox");
  ImageDelivery images(backend_.get(), spool, names);
  for (const auto& [session, last] : sessions) {
    while (!backend_->IsFinished(session, last)) {
      const auto* merger = backend_->Health("merger");
      show(merger == nullptr || merger->message.empty() ? "reading the map" : merger->message);
      backend_->Tick(50);
    }
  }
  LauncherFigures figures;
  figures.title = title_;
  figures.images = images.Finish([&] { backend_->Tick(50); }, show);
  figures.shutter = FindShutter(backend_->Health("merger"));
  figures.processes = backend_->StopAll();
  figures.wall_s = std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count();
  if (options_.with_merger) TakeOver();
  return options_.out.empty() ? "" : FinishRun(options_.out, figures, options_.place.db);
}

void TellProblems(const MapPlace& place, const std::vector<std::string>& problems) {
  if (problems.empty()) return;
  for (const std::string& problem : problems) std::fprintf(stderr, "mapmend: %s\n", problem.c_str());
  std::fprintf(stderr,
               "mapmend: what is sound is mapped; the file as it was is %s.damaged, `mapmend db repair` may mend it\n",
               place.db.c_str());
  throw CLI::RuntimeError(kExitInputCutShort);
}

}  // namespace mapmend
