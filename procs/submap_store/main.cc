// submap_store: the durable log of every flight and the retrieval over it; also the tools that look into its files.

#include <SQLiteCpp/SQLiteCpp.h>
#include <spdlog/spdlog.h>

#include <CLI/CLI.hpp>
#include <memory>
#include <stdexcept>

#include "libs/base/exit_codes.h"
#include "libs/bus/process.h"
#include "libs/command_line/command_line.h"
#include "libs/command_line/option_flags.h"
#include "libs/images/image_file.h"
#include "procs/submap_store/db_commands.h"
#include "procs/submap_store/image_store.h"
#include "procs/submap_store/store_adapter.h"

namespace mapmend {
namespace {

std::unique_ptr<SubmapStore> Open(const SubmapStoreOptions& options) {
  try {
    return std::make_unique<SubmapStore>(options);
  } catch (const SQLite::Exception& e) {
    throw std::runtime_error(options.path + ": " + e.what());
  }
}

// Images follow the keyframes that are committed.
std::unique_ptr<ImageStore> OpenImages(const ImageStoreOptions& options, SubmapStore* store) {
  std::vector<ImageStore::Keyframe> keyframes;
  for (auto& [session, keyframe, frame] : store->Keyframes()) keyframes.push_back({session, keyframe, frame});
  auto images = std::make_unique<ImageStore>(options, std::move(keyframes));
  store->SetListener([images = images.get()](const Record& record) {
    const std::string& session = record.header.session;
    if (const auto* keyframe = std::get_if<KeyframeRecord>(&record.body)) {
      images->Add({session, keyframe->keyframe, keyframe->frame});
    } else if (const auto* update = std::get_if<MapUpdate>(&record.body)) {
      for (const KeyframeId removed : update->removed_keyframes) images->Remove(session, removed);
    }
  });
  return images;
}

int Main(int argc, char** argv) {
  CLI::App app("Stores the stream of records durably in one SQLite file and answers bag-of-words queries over it.",
               "submap_store");
  const bool is_tool = ProgramName("submap_store", argc, argv) != "submap_store";  // `mapmend db`: no store is to run
  ProcessOptions process;
  SubmapStoreOptions options;
  std::string images_path;
  if (is_tool) {
    app.description("Looks into map databases and works on them");
    app.require_subcommand(1);
  } else {
    AddProcessOptions(&app, &process);
    app.add_option("--db", options.path, "database file, made if it does not exist");
    app.add_option(
        "--images", images_path,
        "file for the images of keyframes (default: images.db beside map.db, NAME.images.db beside another)");
    app.add_option("--vocabulary-hash", options.vocabulary_hash, "accept only sessions of this vocabulary");
    app.add_flag("--recording", options.log.is_recording,
                 "the stream is played by lcm-logplayer, which cannot answer: give up what is missing after 2 s");
    app.require_subcommand(0, 1);
    AddOptionFlags(&app, "submap_store", &options);
  }
  AddDbCommands(&app);
  if (const auto code = ParseCommandLine(&app, argc, argv)) return *code;
  ApplyLogLevel(process);
  if (!app.get_subcommands().empty()) return 0;  // it has run
  if (options.path.empty()) throw UsageError("--db is required (or one of info, check, compact, forget, merge, hash)");

  RequireGoodOptions(OptionList::Of(options));
  InstallSignalHandlers();
  auto store = Open(options);  // first: who cannot store must not be heard
  const std::string url = ResolveLcmUrl(process.lcm_url);
  if (images_path.empty()) images_path = ImagePathFor(options.path);
  Bus bus(url, process.channel_prefix);
  try {
    for (;;) {
      const auto images = OpenImages({images_path, url, process.channel_prefix}, store.get());
      StoreAdapter adapter(&bus, store.get(), images.get());
      spdlog::info("submap_store: {} with {} keyframes", options.path, store->GetStatus(0).keyframes);
      while (!StopRequested() && !store->MustReload()) adapter.Spin(10);
      store->CheckPlace();
      if (StopRequested()) return 0;
      store.reset();
      store = Open(options);
    }
  } catch (const FileGone& e) {
    spdlog::error("{}", e.what());
    return e.can_go_on ? 1 : kExitForGood;
  }
}

}  // namespace
}  // namespace mapmend

int main(int argc, char** argv) { return mapmend::RunMain("submap_store", mapmend::Main, argc, argv); }
