#include <filesystem>
#include <stdexcept>

#include "tools/simulate/scenario.h"

namespace mapmend::simulate {

std::string FindDataFolder() {
  namespace fs = std::filesystem;
  const fs::path program = fs::read_symlink("/proc/self/exe").parent_path();
  // Installed in libexec/mapmend or bin; in the source tree's build/bin.
  for (const char* candidate : {"../../share/mapmend", "../share/mapmend", "../../data"}) {
    const fs::path folder = program / candidate;
    if (fs::is_directory(folder / "scenarios") && fs::is_directory(folder / "simulator"))
      return fs::canonical(folder).string();
  }
  throw std::runtime_error("data/scenarios and data/simulator are not found beside " + program.string());
}

}  // namespace mapmend::simulate
