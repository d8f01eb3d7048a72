#include "procs/mapmend/paths.h"

#include <unistd.h>

#include <stdexcept>

namespace mapmend {

namespace fs = std::filesystem;

fs::path ProgramFolder() { return fs::read_symlink("/proc/self/exe").parent_path(); }

std::string FindProgram(const std::string& name) {
  const fs::path folder = ProgramFolder();
  for (const fs::path& path : {folder / name, folder / "../libexec/mapmend" / name}) {
    if (access(path.c_str(), X_OK) == 0 && fs::is_regular_file(path)) return path.lexically_normal().string();
  }
  throw std::runtime_error("program " + name + " is missing: it is neither in " + folder.string() + " nor in " +
                           (folder / "../libexec/mapmend").lexically_normal().string() +
                           "; build or install mapmend again");
}

std::string FindData(const std::string& name) {
  const fs::path folder = ProgramFolder();
  for (const fs::path& path : {folder / "../share/mapmend" / name, folder / "../../data" / name}) {
    std::error_code ignored;
    if (fs::exists(path, ignored)) return path.lexically_normal().string();
  }
  return {};
}

}  // namespace mapmend
