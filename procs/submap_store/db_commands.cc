#include "procs/submap_store/db_commands.h"

#include <SQLiteCpp/SQLiteCpp.h>

#include <CLI/CLI.hpp>
#include <filesystem>
#include <functional>
#include <iostream>
#include <memory>
#include <stdexcept>
#include <utility>

#include "libs/images/image_file.h"
#include "procs/submap_store/db_images.h"

namespace mapmend {
namespace {

constexpr int kExitIncomplete = 3;  // what could be had is there

// Makes a subcommand of a database, whose path it puts where the callbacks find it.
using AddCommand = std::function<CLI::App*(const char* name, const char* description, std::function<void()> run)>;

void AddLookingCommands(const std::shared_ptr<std::string>& path, const AddCommand& add) {
  const auto json = std::make_shared<bool>(false);
  CLI::App* info = add("info", "Say what is in a database", [path, json] {
    if (*json) {
      std::cout << DbInfoJson(*path);
    } else {
      PrintDbInfo(*path);
      std::cout << DescribeImages(*path) << "\n";
    }
  });
  info->add_flag("--json", *json, "as JSON");
  add("check", "Read everything in a database and say what is wrong with it", [path] {
    std::vector<std::string> problems = CheckDb(*path);
    for (std::string& problem : CheckImages(*path)) problems.push_back(std::move(problem));
    for (const std::string& problem : problems) std::cout << problem << "\n";
    if (problems.empty()) std::cout << *path << ": ok\n";
    if (!problems.empty()) throw CLI::RuntimeError(1);
  });
  add("hash", "Print a digest of the stream and of the merged map", [path] {
    const DbHash hash = HashDb(*path);
    std::cout << "stream " << hash.stream << "\nmap    " << (hash.map.empty() ? "none" : hash.map) << "\n";
  });
}

void AddChangingCommands(const std::shared_ptr<std::string>& path, const AddCommand& add) {
  add("compact", "Rewrite a database without unused space, in the newest schema", [path] {
    CompactDb(*path);
    CompactImages(*path);
  });
  add("forget", "Forget the merged map, not the flights: `mapmend merge` makes it anew",
      [path] { ForgetMergedMap(*path); });
  const auto sources = std::make_shared<std::vector<std::string>>();
  add("repair", "Mend a damaged database from recordings, outboxes or other databases of the same flights",
      [path, sources] {
        if (!RepairDb(*path, *sources)) throw CLI::RuntimeError(kExitIncomplete);
      })
      ->add_option("--from", *sources, "where to take what is damaged from (default: what lies in the folder)")
      ->check(CLI::ExistingFile);
  const auto copy = std::make_shared<std::string>();
  CLI::App* copy_flights =
      add("copy-flights", "Copy the flights of a database, without the merged map, into a new one", [path, copy] {
        const std::vector<std::string> problems = CopyFlights(*path, *copy);
        for (const std::string& problem : problems) std::cout << problem << "\n";
        if (!problems.empty()) throw CLI::RuntimeError(kExitIncomplete);
      });
  copy_flights->add_option("OUT", *copy, "the new database file")->required();
  copy_flights->group("");  // for `mapmend merge`
}

void AddMergeCommand(CLI::App* app) {
  CLI::App* merge = app->add_subcommand("merge", "Put the sessions of several databases into a new one");
  const auto inputs = std::make_shared<std::vector<std::string>>();
  const auto out = std::make_shared<std::string>();
  merge->add_option("FILES", *inputs, "database files, or folders of results")->required()->expected(2, 1000);
  merge->add_option("--out", *out, "the new database file")->required();
  merge->callback([inputs, out] {
    for (std::string& input : *inputs) input = DatabaseIn(input);
    if (std::filesystem::exists(ImagePathFor(*out)))
      throw std::runtime_error(ImagePathFor(*out) + ": exists already; name a new file with --out");
    MergeDbs(*inputs, *out);
    if (const int num_images = MergeImages(*inputs, *out); num_images > 0)
      std::cout << ImagePathFor(*out) << ": " << num_images << " images\n";
  });
}

}  // namespace

std::string DatabaseIn(const std::string& path) {
  namespace fs = std::filesystem;
  std::error_code ignored;
  if (!fs::is_directory(path, ignored)) return path;
  const std::string db = (fs::path(path) / "map.db").string();
  if (!fs::exists(db, ignored)) throw std::runtime_error(path + ": the folder holds no map.db");
  return db;
}

void AddDbCommands(CLI::App* app) {
  const auto path = std::make_shared<std::string>();
  const AddCommand add = [app, path](const char* name, const char* description, std::function<void()> run) {
    CLI::App* command = app->add_subcommand(name, description);
    command->add_option("FILE", *path, "database file, or the folder of results that holds its map.db")->required();
    command->callback([path, run = std::move(run)] {
      *path = DatabaseIn(*path);
      try {
        run();
      } catch (const SQLite::Exception& e) {
        throw std::runtime_error(*path + ": " + e.what());
      }
    });
    return command;
  };
  AddLookingCommands(path, add);
  AddChangingCommands(path, add);
  AddMergeCommand(app);
}

}  // namespace mapmend
