#pragma once

#include <optional>
#include <string>
#include <string_view>

namespace mapmend {

struct WebFile {
  std::string_view content;
  const char* type = "";  // MIME
};

// A file of the page's own (web/), by its path in the address, e.g. "/" or "/page/main.js".
std::optional<WebFile> FindWebFile(std::string_view path);

// The file of a Debian package that an address stands for, e.g. "/lib/three/build/three.module.js"; empty if the page
// does not use it.
//   folder  where the packages have their files
std::string FindLibraryFile(std::string_view path, const std::string& folder);

// The MIME type of a file, by its name.
const char* ContentType(std::string_view path);

}  // namespace mapmend
