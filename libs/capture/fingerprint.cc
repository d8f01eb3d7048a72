#include "libs/capture/fingerprint.h"

#include <algorithm>
#include <array>
#include <cstdint>
#include <filesystem>
#include <fstream>

#include "libs/capture/image_list.h"

namespace mapmend {
namespace {

constexpr std::streamoff kEnd = 4096;  // bytes that are looked at, at either end

// FNV-1a, 64 bit (Fowler, Noll, Vo).
void Add(const char* bytes, std::streamsize size, uint64_t* hash) {
  for (std::streamsize i = 0; i < size; ++i) *hash = (*hash ^ static_cast<unsigned char>(bytes[i])) * 0x100000001b3ULL;
}

// Of a file that cannot be read: its size is 0.
std::string FingerprintOfFile(const std::string& path) {
  std::ifstream file(path, std::ios::binary | std::ios::ate);
  const std::streamoff size = std::max<std::streamoff>(file.tellg(), 0);
  uint64_t hash = 0xcbf29ce484222325ULL;
  std::array<char, kEnd> bytes;
  for (const std::streamoff at : {std::streamoff(0), std::max<std::streamoff>(size - kEnd, 0)}) {
    file.clear();
    file.seekg(at);
    file.read(bytes.data(), kEnd);
    Add(bytes.data(), file.gcount(), &hash);
  }
  return std::to_string(size) + ":" + std::to_string(hash) + ";";
}

}  // namespace

std::string ContentFingerprint(const std::vector<std::string>& inputs) {
  std::string text;
  for (const std::string& input : inputs) {
    std::error_code error;
    if (!std::filesystem::is_directory(input, error)) {
      text += FingerprintOfFile(input);
      continue;
    }
    for (const std::string& file : ListImages(input).files) text += FingerprintOfFile(file);
  }
  return text;
}

}  // namespace mapmend
