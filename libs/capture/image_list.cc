#include "libs/capture/image_list.h"

#include <algorithm>
#include <cctype>
#include <filesystem>
#include <fstream>
#include <initializer_list>
#include <iterator>
#include <set>
#include <stdexcept>
#include <string_view>

namespace mapmend {
namespace {

namespace fs = std::filesystem;

constexpr int kMaxDepth = 3;  // of subfolders: CARD/DCIM/100MEDIA

struct Found {
  std::vector<std::string> files, passed_over;
};

// Entries with an image's name. What hides behind a link counts as what the link leads to.
Found FindInFolder(const std::string& folder) {
  std::error_code error;
  fs::directory_iterator entries(folder, error);
  if (error) throw std::runtime_error("input folder " + folder + " cannot be read: " + error.message());
  Found found;
  for (; entries != fs::directory_iterator(); entries.increment(error)) {
    if (error) throw std::runtime_error("input folder " + folder + " cannot be read: " + error.message());
    const fs::path& path = entries->path();
    if (!HasImageName(path.string())) continue;
    const std::string name = path.filename().string();
    std::error_code ignored;
    const fs::file_status status = fs::status(path, ignored);
    if (name.starts_with('.')) {
      found.passed_over.push_back(name + " (hidden)");
    } else if (status.type() == fs::file_type::not_found) {
      found.passed_over.push_back(name + " (a link to nothing)");
    } else if (status.type() == fs::file_type::directory) {
      found.passed_over.push_back(name + " (a folder)");
    } else if (status.type() != fs::file_type::regular && status.type() != fs::file_type::unknown) {
      found.passed_over.push_back(name + " (not a file)");
    } else {
      found.files.push_back(path.string());
    }
  }
  return found;
}

void AddSubfolders(const fs::path& folder, int depth, Found* found) {
  std::error_code error;
  for (fs::directory_iterator entries(folder, error); !error && entries != fs::directory_iterator();
       entries.increment(error)) {
    const fs::path& path = entries->path();
    std::error_code ignored;
    if (!fs::is_directory(path, ignored) || path.filename().string().starts_with('.')) continue;
    const Found below = FindInFolder(path.string());
    found->files.insert(found->files.end(), below.files.begin(), below.files.end());
    found->passed_over.insert(found->passed_over.end(), below.passed_over.begin(), below.passed_over.end());
    if (depth < kMaxDepth) AddSubfolders(path, depth + 1, found);
  }
}

bool IsDigit(char c) { return c >= '0' && c <= '9'; }

// The digits at text[at...], and moves at behind them.
std::string_view TakeDigits(const std::string& text, size_t* at) {
  const size_t begin = *at;
  while (*at < text.size() && IsDigit(text[*at])) ++*at;
  return std::string_view(text).substr(begin, *at - begin);
}

std::string NameOf(const std::string& path) { return fs::path(path).filename().string(); }

bool EndsLikeOneOf(const std::string& path, std::initializer_list<std::string_view> endings) {
  std::string ending = fs::path(path).extension().string();
  std::transform(ending.begin(), ending.end(), ending.begin(), [](unsigned char c) { return std::tolower(c); });
  return std::find(endings.begin(), endings.end(), ending) != endings.end();
}

// The first of some names, in natural order.
std::string FirstOf(std::vector<std::string> names) {
  constexpr size_t kNamed = 3;
  std::sort(names.begin(), names.end(), NaturalLess);
  std::string text;
  for (size_t i = 0; i < std::min(kNamed, names.size()); ++i) text += (i > 0 ? ", " : "") + names[i];
  return names.size() > kNamed ? text + ", ..." : text;
}

// What a file may be the copy of, if file managers or browsers named it: DSC1 of "DSC1 (2)", "DSC1 - Copy", "DSC1
// copy 2", "DSC1 (copy)".
std::vector<std::string> OriginalStems(const std::string& stem) {
  std::vector<std::string> originals;
  const auto add = [&](std::string original) {
    original.erase(original.find_last_not_of(" _-(") + 1);
    if (!original.empty()) originals.push_back(std::move(original));
  };
  if (size_t at = stem.rfind('('); at != std::string::npos && stem.ends_with(')')) {
    const size_t bracket = at++;
    if (!TakeDigits(stem, &at).empty() && at + 1 == stem.size()) add(stem.substr(0, bracket));
  }
  std::string lower = stem;
  std::transform(lower.begin(), lower.end(), lower.begin(), [](unsigned char c) { return std::tolower(c); });
  for (const char* word : {"copy", "kopie", "copie", "copia"}) {
    if (const size_t at = lower.rfind(word); at != std::string::npos) add(stem.substr(0, at));
  }
  return originals;
}

bool HaveTheSameBytes(const std::string& a, const std::string& b) {
  std::error_code error;
  if (fs::file_size(a, error) != fs::file_size(b, error) || error) return false;
  std::ifstream x(a, std::ios::binary), y(b, std::ios::binary);
  using Bytes = std::istreambuf_iterator<char>;
  return x && y && std::equal(Bytes(x), Bytes(), Bytes(y), Bytes());
}

// Takes the copies of other files out, and returns their names.
std::vector<std::string> TakeCopies(std::vector<std::string>* files) {
  const std::set<std::string> all(files->begin(), files->end());
  std::vector<std::string> copies;
  std::erase_if(*files, [&](const std::string& file) {
    const fs::path path(file);
    for (const std::string& stem : OriginalStems(path.stem().string())) {
      const std::string original = (path.parent_path() / (stem + path.extension().string())).string();
      if (!all.contains(original) || !HaveTheSameBytes(file, original)) continue;
      copies.push_back(NameOf(file));
      return true;
    }
    return false;
  });
  return copies;
}

// "; ..." if the folder holds what people may have meant: videos, or photos as they come from the sensor.
std::string WhatElseIsThere(const std::string& folder) {
  std::string video, raw;
  std::error_code error;
  for (fs::recursive_directory_iterator entries(folder, fs::directory_options::skip_permission_denied, error);
       !error && entries != fs::recursive_directory_iterator(); entries.increment(error)) {
    const std::string path = entries->path().string();
    if (entries.depth() >= kMaxDepth) entries.disable_recursion_pending();
    if (NameOf(path).starts_with('.')) continue;
    const bool is_raw = EndsLikeOneOf(path, {".dng", ".heic", ".heif", ".avif", ".jxl", ".arw", ".cr2", ".cr3", ".nef",
                                             ".orf", ".raf", ".rw2", ".raw", ".jp2", ".gif"});
    std::string& first = HasVideoName(path) ? video : raw;
    if ((is_raw || HasVideoName(path)) && (first.empty() || NaturalLess(path, first))) first = path;
  }
  if (!video.empty()) return "; videos are inputs one by one: " + video;
  return raw.empty() ? "" : "; " + NameOf(raw) + " and its like are not read: make JPEGs of them";
}

}  // namespace

bool HasImageName(const std::string& path) {
  return EndsLikeOneOf(path, {".jpg", ".jpeg", ".png", ".bmp", ".tif", ".tiff", ".pgm", ".ppm", ".webp"});
}

bool HasVideoName(const std::string& path) {
  return EndsLikeOneOf(path, {".mp4", ".mov", ".avi", ".mkv", ".webm", ".m4v", ".ts", ".mts", ".flv", ".mpg", ".h264",
                              ".hevc", ".wmv", ".3gp"});
}

bool NaturalLess(const std::string& a, const std::string& b) {
  size_t i = 0, j = 0;
  while (i < a.size() && j < b.size()) {
    if (IsDigit(a[i]) && IsDigit(b[j])) {
      std::string_view x = TakeDigits(a, &i), y = TakeDigits(b, &j);
      x.remove_prefix(std::min(x.find_first_not_of('0'), x.size()));
      y.remove_prefix(std::min(y.find_first_not_of('0'), y.size()));
      if (x.size() != y.size()) return x.size() < y.size();
      if (x != y) return x < y;
    } else {
      if (a[i] != b[j]) return static_cast<unsigned char>(a[i]) < static_cast<unsigned char>(b[j]);
      ++i, ++j;
    }
  }
  if (i < a.size() || j < b.size()) return j < b.size();
  return a < b;  // they differ in leading zeros only
}

ImageList SortImages(std::vector<std::string> files) {
  ImageList list;
  list.files = std::move(files);
  std::sort(list.files.begin(), list.files.end());
  std::vector<std::string> natural = list.files;
  std::sort(natural.begin(), natural.end(), NaturalLess);
  if (natural != list.files) {
    list.files = std::move(natural);
    list.notes.push_back("the names hold numbers of different width: taken by number, " + NameOf(list.files.front()) +
                         " first, " + NameOf(list.files.back()) + " last");
  }
  return list;
}

ImageList ListImages(const std::string& folder) {
  Found found = FindInFolder(folder);
  const bool below = found.files.empty();
  if (below) AddSubfolders(folder, 1, &found);
  if (found.files.empty()) {
    throw std::runtime_error("input folder " + folder + " holds no images (jpg, png, bmp, tif, pgm, ppm, webp)" +
                             WhatElseIsThere(folder));
  }
  const std::vector<std::string> copies = TakeCopies(&found.files);
  ImageList list = SortImages(std::move(found.files));
  if (copies.size() == 1) list.notes.push_back(copies.front() + " is a copy of another image and is left out");
  if (copies.size() > 1)
    list.notes.push_back(std::to_string(copies.size()) + " copies of other images are left out: " + FirstOf(copies));
  if (below) {
    list.notes.push_back("images from the subfolders of " + folder + ", " +
                         fs::path(list.files.front()).lexically_relative(folder).string() + " to " +
                         fs::path(list.files.back()).lexically_relative(folder).string());
  }
  if (!found.passed_over.empty()) {
    const size_t count = found.passed_over.size();
    list.notes.push_back(std::to_string(count) +
                         (count == 1 ? " entry only looks like an image and is passed over: "
                                     : " entries only look like images and are passed over: ") +
                         FirstOf(std::move(found.passed_over)));
  }
  return list;
}

std::vector<std::string> ImagesOf(const std::vector<std::string>& inputs) {
  std::vector<std::string> files, images;
  std::error_code error;
  for (const std::string& input : inputs) {
    if (fs::is_directory(input, error)) {
      const std::vector<std::string> in_folder = ListImages(input).files;
      files.insert(files.end(), in_folder.begin(), in_folder.end());
    } else if (HasImageName(input)) {
      images.push_back(input);
    } else {
      return {};
    }
  }
  if (!images.empty()) files = SortImages(images).files;
  return files;
}

}  // namespace mapmend
