#include "procs/submap_store/db_commands.h"

#include <SQLiteCpp/SQLiteCpp.h>

#include <iostream>
#include <memory>
#include <stdexcept>

namespace mapmend {

void AddDbCommands(CLI::App* app) {
  const auto path = std::make_shared<std::string>();
  const auto add = [&](const char* name, const char* description, std::function<void()> run) {
    CLI::App* command = app->add_subcommand(name, description);
    command->add_option("FILE", *path, "database file")->required();
    command->callback([path, run = std::move(run)] {
      try {
        run();
      } catch (const SQLite::Exception& e) {
        throw std::runtime_error(*path + ": " + e.what());
      }
    });
  };
  add("info", "Say what is in a database", [path] { PrintDbInfo(*path); });
  add("check", "Read everything in a database and say what is wrong with it", [path] {
    const std::vector<std::string> problems = CheckDb(*path);
    for (const std::string& problem : problems) std::cout << problem << "\n";
    if (problems.empty()) std::cout << *path << ": ok\n";
    if (!problems.empty()) throw CLI::RuntimeError(1);
  });
  add("compact", "Rewrite a database without unused space, in the newest schema", [path] { CompactDb(*path); });
  add("forget", "Forget the merged map, not the flights: `mapmend merge` makes it anew",
      [path] { ForgetMergedMap(*path); });
  add("hash", "Print a digest of the stream and of the merged map", [path] {
    const DbHash hash = HashDb(*path);
    std::cout << "stream " << hash.stream << "\nmap    " << (hash.map.empty() ? "none" : hash.map) << "\n";
  });
  CLI::App* merge = app->add_subcommand("merge", "Put the sessions of several databases into a new one");
  const auto inputs = std::make_shared<std::vector<std::string>>();
  const auto out = std::make_shared<std::string>();
  merge->add_option("FILES", *inputs, "database files")->required()->expected(2, 1000);
  merge->add_option("--out", *out, "the new database file")->required();
  merge->callback([inputs, out] { MergeDbs(*inputs, *out); });
}

}  // namespace mapmend
