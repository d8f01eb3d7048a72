#include "procs/viewer_export/edge_export.h"

#include <algorithm>
#include <cstdio>
#include <filesystem>
#include <set>
#include <stdexcept>
#include <vector>

#include "libs/base/write_file.h"
#include "procs/viewer_export/connection_picture.h"

namespace mapmend {
namespace {

namespace fs = std::filesystem;

constexpr size_t kMostPictures = 40;  // some 60 KB each, in the report
constexpr int kHeight = 360;          // pixels

// The numbers in such a name; false if it is none.
bool ParseName(const std::string& name, std::pair<int, int>* numbers) {
  int length = 0;
  return std::sscanf(name.c_str(), "%d-%d.jpg%n", &numbers->first, &numbers->second, &length) == 2 &&
         length == static_cast<int>(name.size());
}

}  // namespace

std::string EdgePictureName(int a, int b) {
  return std::to_string(std::min(a, b)) + "-" + std::to_string(std::max(a, b)) + ".jpg";
}

void ExportEdgePictures(const Snapshot& snapshot, const PictureSource& source, const std::string& folder) {
  std::vector<const EvaluatedConnection*> tree;
  for (const EvaluatedConnection& connection : snapshot.model->Revision().connections) {
    if (connection.in_tree && snapshot.FindSubmap(connection.a) >= 0 && snapshot.FindSubmap(connection.b) >= 0)
      tree.push_back(&connection);
  }
  std::stable_sort(tree.begin(), tree.end(), [](const auto* p, const auto* q) { return p->strength > q->strength; });
  tree.resize(std::min(tree.size(), kMostPictures));
  std::set<std::string> written;
  std::error_code error;
  for (const EvaluatedConnection* connection : tree) {
    const std::vector<uint8_t> picture = DrawConnection(snapshot, *connection, source, {kHeight, "jpeg"});
    if (picture.empty()) continue;
    const std::string name =
        EdgePictureName(snapshot.submaps[static_cast<size_t>(snapshot.FindSubmap(connection->a))].number,
                        snapshot.submaps[static_cast<size_t>(snapshot.FindSubmap(connection->b))].number);
    fs::create_directories(folder, error);
    if (error) throw std::runtime_error("cannot create the directory " + folder + ": " + error.message());
    WriteFile((fs::path(folder) / name).string(), std::string(picture.begin(), picture.end()));
    written.insert(name);
  }
  std::vector<fs::path> stale;
  for (const auto& entry : fs::directory_iterator(folder, error)) {
    std::pair<int, int> numbers;
    const std::string name = entry.path().filename().string();
    if (ParseName(name, &numbers) && !written.contains(name)) stale.push_back(entry.path());
  }
  for (const fs::path& path : stale) fs::remove(path, error);
}

std::map<std::pair<int, int>, std::string> ReadEdgePictures(const std::string& folder) {
  std::map<std::pair<int, int>, std::string> pictures;
  std::error_code error;
  for (const auto& entry : fs::directory_iterator(folder, error)) {
    std::pair<int, int> numbers;
    if (ParseName(entry.path().filename().string(), &numbers)) pictures[numbers] = ReadFile(entry.path().string());
  }
  return pictures;
}

}  // namespace mapmend
