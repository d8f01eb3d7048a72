#pragma once

#include <string>
#include <string_view>

namespace mapmend {

// Writes a whole file under a temporary name beside it, then renames it, so that a crash never leaves half a file under
// the real name. Throws std::runtime_error with one line ("cannot write PATH: reason") and removes the temporary file.
void WriteFile(const std::string& path, std::string_view content);

// A whole file as bytes. Throws std::runtime_error with one line ("cannot read PATH: reason").
std::string ReadFile(const std::string& path);

}  // namespace mapmend
