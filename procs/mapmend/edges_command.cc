#include <unistd.h>

#include <CLI/CLI.hpp>
#include <algorithm>
#include <chrono>
#include <cstdio>
#include <filesystem>
#include <map>
#include <memory>
#include <stdexcept>

#include "libs/base/backoff.h"
#include "libs/base/write_file.h"
#include "libs/bus/channels.h"
#include "libs/bus/process.h"
#include "libs/wire/revision_codec.h"
#include "libs/wire/store_client.h"
#include "procs/mapmend/commands.h"
#include "procs/mapmend/edge_table.h"
#include "procs/mapmend/map_file.h"
#include "procs/mapmend/progress.h"
#include "procs/mapmend/run_flight.h"
#include "procs/mapmend/run_state.h"
#include "procs/mapmend/run_tool.h"
#include "procs/mapmend/stderr_redirection.h"

namespace mapmend {
namespace {

using Clock = std::chrono::steady_clock;

struct EdgesOptions {
  MapFileOptions file;
  std::string map, channel_prefix;
  std::vector<std::string> submaps;  // the two that the edge joins; none for list
  bool disable = false, json = false, show = false;
  std::string picture;  // with show; empty: in the folder of results, or here
};

// The bus of a run that is writing into this folder now, or of a URL; empty: nothing runs.
std::string LiveUrl(const std::string& map) {
  if (map.find("://") != std::string::npos) return map;
  return IsRunning(map) ? ReadBusAddress(map) : "";
}

std::vector<std::string> SessionOrder(StoreClient* store) {
  const auto reply = store->Fetch(FetchRequest{});
  if (!reply) throw std::runtime_error("the store does not answer");
  std::vector<std::string> sessions;
  for (const StreamCursor& cursor : reply->sessions) sessions.push_back(cursor.session);
  return sessions;
}

std::vector<EdgeDecision> Decide(StoreClient* store, const std::vector<EdgeDecision>& decisions) {
  const auto reply = store->DecideEdges(decisions);
  if (!reply) throw std::runtime_error("the store does not take the decision");
  return *reply;
}

EdgeDecision MakeDecision(const EdgesOptions& options, const EdgeTable& table) {
  const EdgeDecision decision{table.FindSubmap(options.submaps[0]), table.FindSubmap(options.submaps[1]),
                              options.disable};
  if (decision.a == decision.b) {
    throw std::runtime_error("an edge joins two submaps: name two different ones");
  }
  return decision;
}

constexpr std::chrono::milliseconds kNoLinkRetry(50);

// One graph, asked of the merger until is_wanted holds for it.
GraphReply AskMerger(Bus* bus, int timeout_ms, const std::function<bool(const GraphReply&)>& is_wanted) {
  GraphRequest request;
  request.requester = "edges-" + std::to_string(getpid());
  std::optional<GraphReply> graph;
  const Subscription subscription =
      bus->Subscribe<GraphReply>(channels::kGraph, Delivery::kKeepAll, [&](const GraphReply& reply) {
        if (reply.requester == request.requester && reply.id == request.id) graph = reply;
      });
  const auto deadline = Clock::now() + std::chrono::milliseconds(timeout_ms);
  Backoff backoff(std::chrono::milliseconds(1000), std::chrono::milliseconds(8000));
  while (Clock::now() < deadline && !StopRequested()) {
    // The same id until it is answered: a merger that is comparing all submaps answers when that is done.
    const auto resend = Clock::now() + (bus->Publish(channels::kGraphRequest, request) ? backoff.Next() : kNoLinkRetry);
    while (!graph && Clock::now() < std::min(resend, deadline) && !StopRequested()) bus->Handle(50);
    if (!graph) continue;
    if (is_wanted(*graph)) return *graph;
    graph.reset();
    ++request.id;
    backoff.Reset();
    const auto again = Clock::now() + std::chrono::milliseconds(200);
    while (Clock::now() < again && !StopRequested()) bus->Handle(50);
  }
  throw std::runtime_error("the merger does not answer");
}

void Print(const EdgesOptions& options, const EdgeTable& table, const std::vector<EdgeDecision>& decisions) {
  std::fputs((options.json ? table.Json(decisions) : table.Text(decisions)).c_str(), stdout);
}

// Where `edges show` draws to.
std::string PicturePath(const EdgesOptions& options, const std::string& folder) {
  if (!options.picture.empty()) return options.picture;
  std::string name = options.submaps[0] + "-" + options.submaps[1] + ".png";
  std::replace(name.begin(), name.end(), ':', '_');
  std::replace(name.begin(), name.end(), '/', '_');
  if (folder.empty()) return "edge-" + name;
  std::filesystem::create_directories(folder + "/edges");
  return folder + "/edges/" + name;
}

// The connection is drawn by viewer_export, which has what is needed for it, from the store behind this URL. Returns
// what it says.
std::string Show(const EdgesOptions& options, const EdgeTable& table, const std::string& url,
                 const std::string& folder) {
  const EdgeDecision edge = MakeDecision(options, table);
  const auto name = [](const SubmapKey& key) { return key.session + ":" + std::to_string(key.submap.value); };
  const std::string log =
      (std::filesystem::temp_directory_path() / ("mapmend-edge-" + std::to_string(getpid()))).string();
  std::vector<std::string> argv = {"viewer_export", "--edge",    name(edge.a),
                                   name(edge.b),    "--picture", PicturePath(options, folder),
                                   "--lcm-url",     url};
  if (!options.channel_prefix.empty()) argv.insert(argv.end(), {"--channel-prefix", options.channel_prefix});
  std::error_code ignored;
  std::filesystem::remove(log, ignored);
  std::string said;
  try {
    RunTool(argv, log, "cannot show this connection");
    said = ReadFile(log);
  } catch (...) {
    std::filesystem::remove(log, ignored);
    throw;
  }
  std::filesystem::remove(log, ignored);
  return said;
}

void WorkLive(const EdgesOptions& options, const std::string& url) {
  const StderrRedirection quiet("/dev/null");
  Bus bus(url, options.channel_prefix);
  StoreClient store(&bus, "edges-" + std::to_string(getpid()));
  constexpr int kAnswerMs = 5000, kHeedMs = 60000;  // a merger that compares all submaps answers when that is done
  if (options.submaps.empty()) {
    const EdgeTable table(AskMerger(&bus, kHeedMs, [](const GraphReply&) { return true; }), SessionOrder(&store));
    Print(options, table, Decide(&store, {}));
    return;
  }
  const std::vector<std::string> sessions = SessionOrder(&store);
  if (options.show) {
    const EdgeTable table(AskMerger(&bus, kHeedMs, [](const GraphReply&) { return true; }), sessions);
    std::fputs(Show(options, table, url, options.map.find("://") == std::string::npos ? options.map : "").c_str(),
               stdout);
    return;
  }
  const EdgeTable before(AskMerger(&bus, kAnswerMs, [](const GraphReply&) { return true; }), sessions);
  const std::vector<EdgeDecision> all = Decide(&store, {MakeDecision(options, before)});
  const EdgeTable after(
      AskMerger(&bus, kHeedMs,
                [&](const GraphReply& graph) { return graph.num_decisions >= static_cast<int>(all.size()); }),
      sessions);
  Print(options, after, all);
}

EdgeTable ReadTable(Backend* backend, const std::string& db) {
  StoreClient store(backend->bus(), "edges-" + std::to_string(getpid()));
  StoreClient::FetchedRevision stored = store.FetchRevision(-1);
  if (stored.status != StoreClient::RevisionStatus::kOk) {
    throw std::runtime_error(db + ": holds no merged map; `mapmend merge` makes one");
  }
  GraphReply graph;
  graph.transforms = std::move(stored.revision.transforms);
  graph.connections = std::move(stored.revision.connections);
  return {std::move(graph), SessionOrder(&store)};
}

// Whether the last word on this pair of submaps says the same; without any, an edge is not disabled.
bool IsInForce(const EdgeDecision& decision, const std::vector<EdgeDecision>& all) {
  const auto ends = [](const EdgeDecision& d) { return std::pair(std::min(d.a, d.b), std::max(d.a, d.b)); };
  bool is_disabled = false;
  for (const EdgeDecision& earlier : all) {
    if (ends(earlier) == ends(decision)) is_disabled = earlier.disabled;
  }
  return is_disabled == decision.disabled;
}

// The decision and the map made after it take the place of what was there in one step.
void WorkOnFile(EdgesOptions options) {
  options.file.place = FindMap(options.map);
  std::vector<EdgeDecision> decisions;
  std::optional<EdgeDecision> decision;
  std::vector<std::string> problems;
  {
    MapFile map(options.file);
    const EdgeTable table = ReadTable(map.backend(), options.file.place.db);
    StoreClient store(map.backend()->bus(), "edges-" + std::to_string(getpid()));
    if (options.show) {
      const std::string said = Show(options, table, map.backend()->Url(), options.file.place.folder);
      map.backend()->StopAll();
      std::fputs(said.c_str(), stdout);
      return;
    }
    decisions = Decide(&store, {});
    if (!options.submaps.empty()) decision = MakeDecision(options, table);
    if (options.submaps.empty() || IsInForce(*decision, decisions)) {
      if (!options.submaps.empty() && !options.json) std::puts("it is so already");
      Print(options, table, decisions);
      map.backend()->StopAll();
      return;
    }
    map.backend()->StopAll();
  }
  Progress progress(options.json);
  options.file.with_merger = true;
  options.file.out = options.file.place.folder;
  {
    MapFile map(options.file);
    StoreClient store(map.backend()->bus(), "edges-" + std::to_string(getpid()));
    decisions = Decide(&store, {*decision});
    const std::string exports = map.Finish([&](const std::string& text) { progress.Show(text); });
    if (!exports.empty()) progress.Say(exports);
    problems = map.Problems();
  }
  options.file.with_merger = false;
  options.file.out.clear();
  {
    MapFile map(options.file);
    Print(options, ReadTable(map.backend(), options.file.place.db), decisions);
    map.backend()->StopAll();
  }
  TellProblems(options.file.place, problems);
}

void Work(const EdgesOptions& options) {
  InstallSignalHandlers();
  try {
    const std::string url = LiveUrl(options.map);
    if (url.empty()) {
      WorkOnFile(options);
    } else {
      WorkLive(options, url);
    }
  } catch (const Interrupted&) {
    throw CLI::RuntimeError(kExitInterrupted);
  }
}

enum class Action { kList, kDisable, kEnable, kShow };

void AddAction(CLI::App* edges, const std::string& name, const std::string& description, Action action) {
  CLI::App* sub = edges->add_subcommand(name, description);
  const auto options = std::make_shared<EdgesOptions>();
  options->disable = action == Action::kDisable;
  options->show = action == Action::kShow;
  sub->add_option("MAP", options->map,
                  "folder of results (of a run that goes on, too), a map database, or the LCM URL of a live system")
      ->required();
  if (action != Action::kList) {
    sub->add_option("SUBMAPS", options->submaps,
                    "the two submaps, numbered as in the report, or SESSION:NUMBER with their session's name or its "
                    "beginning")
        ->required()
        ->expected(2);
  }
  if (options->show) {
    sub->add_option("--out", options->picture,
                    "the PNG file (default: edges/A-B.png in the folder of results, else ./edge-A-B.png)");
    options->file.settings.AddFlags(sub, {"hub", "submap_store", "viewer_export"});
  } else if (action != Action::kList) {
    sub->add_option("--seed", options->file.seed,
                    "for a file, of everything random (default: that of the flight's run)");
    sub->add_option("--groundtruth", options->file.groundtruth, "for a folder of results: TUM file for the report");
    options->file.settings.AddFlags(sub, {"hub", "submap_store", "merger", "viewer_export"});
  }
  sub->add_option("--vocabulary", options->file.vocabulary,
                  "for a file: the one of the flights (default: mapmend's own)");
  sub->add_option("--channel-prefix", options->channel_prefix, "of a live system");
  if (!options->show) sub->add_flag("--json", options->json, "the graph as JSON instead of the table");
  sub->callback([options] {
    options->file.settings.Resolve();
    Work(*options);
  });
}

}  // namespace

void AddEdgesCommand(CLI::App* app) {
  CLI::App* sub = app->add_subcommand("edges", "Look at the connections between submaps; switch one off, or on again");
  sub->require_subcommand(1);
  AddAction(sub, "list", "Every pair of submaps that was compared, with strength, verdict and reason", Action::kList);
  AddAction(sub, "show", "Draw the frames that say most about a connection side by side, with what was matched in them",
            Action::kShow);
  AddAction(sub, "disable", "Do not use a connection, whatever speaks for it; the merged map is made without it",
            Action::kDisable);
  AddAction(sub, "enable", "Take back a disable: the merger decides about the connection again", Action::kEnable);
  sub->footer(
      "Decisions are kept in the map database: they hold after a restart, and for flights that are added later. On a "
      "run that\n"
      "goes on they are heeded at once; on a file the merged map, and the exports of a folder, are made anew.");
}

}  // namespace mapmend
