#include "procs/viewer_export/web_files.h"

#include <web/page_files.h>

#include <array>
#include <utility>

namespace mapmend {
namespace {

// All that the page uses of libjs-three and libjs-leaflet.
constexpr std::array<std::string_view, 4> kLibraryFiles = {"three/build/three.module.js",
                                                           "three/examples/jsm/controls/OrbitControls.js",
                                                           "leaflet/leaflet.esm.min.js", "leaflet/leaflet.css"};

}  // namespace

std::optional<WebFile> FindWebFile(std::string_view path) {
  const std::string_view name = path == "/" ? "/page/index.html" : path;
  for (const EmbeddedFile& file : kPageFiles) {
    if (name == file.path) return WebFile{file.content, ContentType(name)};
  }
  return std::nullopt;
}

std::string FindLibraryFile(std::string_view path, const std::string& folder) {
  constexpr std::string_view kPrefix = "/lib/";
  if (!path.starts_with(kPrefix)) return "";
  for (const std::string_view file : kLibraryFiles) {
    if (path.substr(kPrefix.size()) == file) return folder + "/" + std::string(file);
  }
  return "";
}

const char* ContentType(std::string_view path) {
  static constexpr std::pair<std::string_view, const char*> kTypes[] = {{".html", "text/html; charset=utf-8"},
                                                                        {".css", "text/css; charset=utf-8"},
                                                                        {".js", "text/javascript; charset=utf-8"},
                                                                        {".json", "application/json"},
                                                                        {".svg", "image/svg+xml"},
                                                                        {".png", "image/png"},
                                                                        {".jpg", "image/jpeg"},
                                                                        {".txt", "text/plain; charset=utf-8"},
                                                                        {".tum", "text/plain; charset=utf-8"},
                                                                        {".csv", "text/csv; charset=utf-8"},
                                                                        {".log", "text/plain; charset=utf-8"}};
  for (const auto& [ending, type] : kTypes) {
    if (path.ends_with(ending)) return type;
  }
  return "application/octet-stream";
}

}  // namespace mapmend
