#include <CLI/CLI.hpp>
#include <algorithm>
#include <chrono>
#include <cstdio>
#include <filesystem>
#include <memory>
#include <nlohmann/json.hpp>
#include <stdexcept>

#include "libs/bus/process.h"
#include "libs/retrieval/vocabulary.h"
#include "procs/mapmend/backend.h"
#include "procs/mapmend/bus_plan.h"
#include "procs/mapmend/commands.h"
#include "procs/mapmend/finish_run.h"
#include "procs/mapmend/image_delivery.h"
#include "procs/mapmend/log_reader.h"
#include "procs/mapmend/out_folder.h"
#include "procs/mapmend/page_access.h"
#include "procs/mapmend/paths.h"
#include "procs/mapmend/progress.h"
#include "procs/mapmend/record_sender.h"
#include "procs/mapmend/run_flight.h"
#include "procs/mapmend/run_state.h"
#include "procs/mapmend/session_rescue.h"

namespace mapmend {
namespace {

using Clock = std::chrono::steady_clock;

struct ReplayOptions {
  std::vector<std::string> logs;
  std::string out = "mapmend-replay", vocabulary, groundtruth, lcm_url, channel_prefix, log_level = "info";
  std::optional<int> seed;
  std::optional<int> port;  // unset: a free one from 8080 on; 0: no page
  double speed = 0;
  bool overwrite = false;
  ExportSettings exports;
  ProcessSettings settings;
};

// Sends the whole recording to the store: as fast as it commits, or `speed` times as fast as it was flown.
void SendAll(LogReader* log, double speed, Backend* backend, Progress* progress) {
  RecordSender sender(backend->bus());
  const int64_t total = log->NumLeft();
  int64_t num_sent = 0;
  bool at_end = false;
  std::optional<EncodedRecord> next;
  const auto start = Clock::now();
  std::optional<int64_t> first_utime;
  const auto is_due = [&](const EncodedRecord& record) {
    const auto header = PeekHeader(record.data.data(), static_cast<int>(record.data.size()));
    if (!(speed > 0) || !header) return true;
    if (!first_utime) first_utime = header->utime;
    const double elapsed_us = std::chrono::duration<double, std::micro>(Clock::now() - start).count();
    return static_cast<double>(header->utime - *first_utime) <= speed * elapsed_us;
  };
  while (!at_end || !sender.AllAcknowledged()) {
    while (!at_end && sender.CanSend()) {
      if (!next) next = log->Next();
      at_end = !next;
      if (at_end || !is_due(*next)) break;
      sender.Send(std::move(*next));
      next.reset();
      ++num_sent;
    }
    sender.Tick();
    backend->Tick(sender.AllAcknowledged() ? (speed > 0 && !at_end ? 5 : 0) : 10);
    progress->Show(std::to_string(std::min(num_sent, total)) + " of " + std::to_string(total) + " records sent" +
                   (sender.StoreError().empty() ? "" : "; store: " + sender.StoreError()));
  }
}

bool AllFinished(const Backend& backend, const LogReader& log) {
  for (const auto& [session, seq] : log.LastRecords()) {
    if (!backend.IsFinished(session, seq)) return false;
  }
  return true;
}

// The recording as a person names it.
std::string NameOf(const std::vector<std::string>& logs) {
  return logs.front() + (logs.size() > 1 ? " and others" : "");
}

// Returns the vocabulary's hash. Throws std::runtime_error if the recording was made with another one.
std::string CheckVocabulary(const ReplayOptions& options, const LogReader& log) {
  const std::string hash = Vocabulary::Read(options.vocabulary).Hash();
  if (log.VocabularyHash().empty() || log.VocabularyHash() == hash) return hash;
  throw std::runtime_error("log " + NameOf(options.logs) + " was recorded with the vocabulary " + log.VocabularyHash() +
                           ", " + options.vocabulary + " is " + hash + ": give the right one with --vocabulary");
}

BackendOptions MakeBackendOptions(const ReplayOptions& options, const std::string& vocabulary_hash, int port) {
  BackendOptions backend;
  backend.out = options.out;
  backend.vocabulary = options.vocabulary;
  backend.vocabulary_hash = vocabulary_hash;
  backend.groundtruth = options.groundtruth;
  backend.lcm_url = options.lcm_url;
  backend.channel_prefix = options.channel_prefix;
  backend.log_level = options.log_level;
  backend.seed = options.seed;
  backend.settings = options.settings;
  backend.export_arguments = options.exports.Arguments();
  backend.with_mosaic = options.exports.DrawsLive();
  backend.port = port;
  return backend;
}

// Sends the recording, waits for its map and stops the processes. The figures lack the time.
LauncherFigures MapLog(const ReplayOptions& options, LogReader* log, Backend* backend, Progress* progress) {
  SendAll(log, options.speed, backend, progress);
  ImageDelivery images(backend, "", SessionNames(backend->bus()));  // a recording holds none
  while (!AllFinished(*backend, *log)) {
    progress->Show("merging");
    backend->Tick(50);
  }
  LauncherFigures figures;
  figures.images = images.Finish([&] { backend->Tick(50); }, [&](const std::string& line) { progress->Show(line); });
  if (log->LastRecords().size() == 1) figures.session = log->LastRecords().begin()->first;
  figures.shutter = FindShutter(backend->Health("merger"));
  figures.processes = backend->StopAll();
  return figures;
}

int Replay(ReplayOptions options) {
  const auto start = Clock::now();
  InstallSignalHandlers();
  if (options.vocabulary.empty()) options.vocabulary = DefaultVocabulary();
  if (options.vocabulary.empty()) throw std::runtime_error("no vocabulary: give one with --vocabulary");
  LogReader log(FindLogs(options.logs));
  const std::string hash = CheckVocabulary(options, log);
  const LivePagePort page(options.port);
  const OutFolder out_folder(options.out, options.overwrite, false);

  Progress progress;
  std::string problem;
  try {
    Backend backend(MakeBackendOptions(options, hash, page.Port()));
    progress.Say("mapping the recording " + NameOf(options.logs) + " into " + options.out + "; bus " + backend.Url() +
                 DescribePage("", page.Port()) + DescribePageToken(backend));
    if (!log.HasChecksums()) {
      progress.Say("the recording carries no checksums (an older program made it): not all damage would be seen");
    }
    const BusAddressFile bus_address(options.out, backend.Url());
    LauncherFigures figures = MapLog(options, &log, &backend, &progress);
    figures.wall_s = std::chrono::duration<double>(Clock::now() - start).count();
    progress.Say(FinishRun(options.out, figures));
    problem = ReadSummary(options.out).value("problem", "");
  } catch (const Interrupted&) {
    progress.Say("interrupted: " + options.out + "/map.db holds what was mapped so far");
    return kExitInterrupted;
  }
  for (const std::string& complaint : log.Complaints()) std::fprintf(stderr, "mapmend: %s\n", complaint.c_str());
  if (!problem.empty()) {
    std::fprintf(stderr, "mapmend: %s\n", problem.c_str());
    return kExitSmallMap;
  }
  return log.Complaints().empty() ? 0 : kExitInputCutShort;
}

}  // namespace

void AddReplayCommand(CLI::App* app) {
  CLI::App* sub =
      app->add_subcommand("replay", "Map from a recording of `mapmend run --record`: the same map without the camera");
  const auto options = std::make_shared<ReplayOptions>();
  sub->add_option("LOG", options->logs,
                  "event log of lcm-logger; several parts of one recording, or a folder that holds nothing else of "
                  "that kind")
      ->required();
  sub->add_option("--out", options->out, "folder of the results")->capture_default_str();
  options->exports.AddMosaicOption(sub);
  sub->add_flag("--overwrite", options->overwrite, "replace the results of an earlier run in --out");
  sub->add_option("--vocabulary", options->vocabulary,
                  "the one that the recording was made with (default: mapmend's own)");
  sub->add_option("--groundtruth", options->groundtruth, "TUM file; the report then tells the accuracy");
  sub->add_option("--seed", options->seed,
                  "of everything random (default: that of the recorded run, which gives the same map)");
  sub->add_option("--speed", options->speed, "times as fast as the camera took the images; 0: as fast as it goes")
      ->check(CLI::NonNegativeNumber)
      ->capture_default_str();
  sub->add_option("--port", options->port, "of the live page, 0: none (default: a free one from 8080 on)");
  AddBusOptions(sub, &options->lcm_url, &options->channel_prefix, &options->log_level);
  options->settings.AddFlags(sub, {"hub", "submap_store", "merger", "viewer_export", "mosaic"});
  sub->footer(
      "Exit codes: 0 done; 1 an error, told in one line; 2 a mistake in the command line; 3 the recording is damaged "
      "or not\ncomplete (what is sound is mapped); 4 the main map holds less than half of the flight; 130 "
      "interrupted.");
  sub->callback([options] {
    options->settings.Resolve();
    options->lcm_url = UrlFromOptionOrEnvironment(options->lcm_url);
    const int code = Replay(*options);
    if (code != 0) throw CLI::RuntimeError(code);
  });
}

}  // namespace mapmend
