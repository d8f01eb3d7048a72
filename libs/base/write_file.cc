#include "libs/base/write_file.h"

#include <unistd.h>

#include <cerrno>
#include <cstdio>
#include <cstring>
#include <memory>
#include <stdexcept>

namespace mapmend {
namespace {

using File = std::unique_ptr<std::FILE, int (*)(std::FILE*)>;

[[noreturn]] void Fail(const std::string& action, const std::string& path, int error) {
  throw std::runtime_error("cannot " + action + " " + path + ": " + std::strerror(error));
}

}  // namespace

void WriteFile(const std::string& path, std::string_view content) {
  const std::string temporary = path + ".tmp" + std::to_string(getpid());
  std::FILE* file = std::fopen(temporary.c_str(), "wb");
  if (file == nullptr) Fail("write", path, errno);
  errno = 0;
  int error = 0;
  if (std::fwrite(content.data(), 1, content.size(), file) != content.size()) error = errno != 0 ? errno : EIO;
  if (std::fclose(file) != 0 && error == 0) error = errno;
  if (error == 0 && std::rename(temporary.c_str(), path.c_str()) != 0) error = errno;
  if (error != 0) {
    std::remove(temporary.c_str());
    Fail("write", path, error);
  }
}

std::string ReadFile(const std::string& path) {
  const File file(std::fopen(path.c_str(), "rb"), &std::fclose);
  if (!file) Fail("read", path, errno);
  std::string content;
  char buffer[65536];
  size_t size = 0;
  while ((size = std::fread(buffer, 1, sizeof(buffer), file.get())) > 0) content.append(buffer, size);
  if (std::ferror(file.get())) Fail("read", path, errno);
  return content;
}

}  // namespace mapmend
