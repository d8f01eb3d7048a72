#include "libs/capture/times_beside.h"

#include <filesystem>
#include <set>

#include "libs/capture/image_list.h"

namespace mapmend {
namespace fs = std::filesystem;

TimesBeside FindTimesBeside(const std::vector<std::string>& inputs) {
  if (inputs.empty()) return {};
  std::error_code error;
  const fs::path first = fs::absolute(inputs.front()).lexically_normal();
  const bool is_folder = fs::is_directory(first, error);
  const fs::path folder = is_folder ? first : first.parent_path(), path = folder / "times.txt";
  if (!fs::exists(path, error)) return {};
  if (is_folder) return inputs.size() == 1 ? TimesBeside{path.string(), ""} : TimesBeside{};
  std::set<fs::path> given;
  for (const std::string& input : inputs) given.insert(fs::absolute(input).lexically_normal());
  for (fs::directory_iterator entry(folder, error); !error && entry != fs::directory_iterator();
       entry.increment(error)) {
    if (HasVideoName(entry->path().string()) && !entry->path().filename().string().starts_with('.') &&
        !given.contains(entry->path())) {
      return {"", "times " + path.string() + " is not taken: it may be that of " + entry->path().filename().string() +
                      ", which lies there too (give it with --times if it belongs to this flight)"};
    }
  }
  return {path.string(), ""};
}

}  // namespace mapmend
