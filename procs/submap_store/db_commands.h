#pragma once

#include <string>
#include <vector>

namespace CLI {
class App;
}  // namespace CLI

// The tools of `mapmend db`: each looks into or rewrites a database file that must not be in use by a store that writes
// it (info, check and hash may read it meanwhile). They throw std::runtime_error with one line for a file that cannot
// be used, and print to stdout.
namespace mapmend {

// Adds info, check, compact, repair, forget, merge and hash as subcommands.
void AddDbCommands(CLI::App* app);

// The database that is meant by a path: the file itself, or map.db in the folder. Throws if the folder holds none.
std::string DatabaseIn(const std::string& path);

// Sessions, submaps, sizes.
void PrintDbInfo(const std::string& path);
// The same but for the sizes of tables, as a JSON object: schema, vocabulary, sessions [{session, vehicle, source,
// records, ended, submaps [{submap, keyframes, points, frames, end_reason, end_detail}], gaps [{first, last,
// reason}]}], images {stored, missing, bytes}, merged {revision, submaps, components, connections_accepted} or null.
std::string DbInfoJson(const std::string& path);

// Reads everything and says what is wrong, one line each. Empty: the file is sound. Every bit that can change what the
// file says is looked at: by a checksum, or by making anew what is derived.
std::vector<std::string> CheckDb(const std::string& path);
// For people, from a record's channel: " (keyframe)"; empty if it is none.
std::string DescribeChannel(const std::string& channel);

// Rewrites the file without free pages, and brings it up to the newest schema.
void CompactDb(const std::string& path);

// Leaves out what is damaged, takes it from other files (ReadRepairSource; without any, from those that lie in its
// folder) where they have it, and fills gaps. The file as it was stays beside it, as PATH.damaged. Says what it did on
// stdout. True if nothing is missing.
bool RepairDb(const std::string& path, std::vector<std::string> sources);

// Removes a database with what SQLite keeps beside it.
void RemoveDb(const std::string& path);

// Makes `out`, in place of what a copy that was killed has left there, from the flights and decisions of one database,
// without its merged map. What is damaged is left out and told, a line each; empty: all is whole.
std::vector<std::string> CopyFlights(const std::string& path, const std::string& out);

// Removes every revision of the merged map with its connections. Flights and people's decisions stay.
void ForgetMergedMap(const std::string& path);

// Makes `out` from the sessions of all inputs, in the order of their start times. Revisions are left behind: the merger
// makes new ones. Throws if sessions disagree or vocabularies differ; then `out` does not exist.
void MergeDbs(const std::vector<std::string>& inputs, const std::string& out);

// SHA-256 over content, not pages. stream: every record of every session, ordered by session name. map: transforms,
// connections and refined geometry of the newest complete revision, without its number; empty if there is none.
struct DbHash {
  std::string stream, map;
};
DbHash HashDb(const std::string& path);

}  // namespace mapmend
