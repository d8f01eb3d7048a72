#include "libs/bus/access_token.h"

#include <fcntl.h>
#include <spdlog/spdlog.h>
#include <sys/random.h>
#include <sys/stat.h>
#include <unistd.h>

#include <cerrno>
#include <cstring>
#include <fstream>
#include <stdexcept>

namespace mapmend {
namespace {

constexpr size_t kMinLength = 16, kMaxLength = 256;

std::string RandomHex() {
  unsigned char bytes[16];
  if (getrandom(bytes, sizeof(bytes), 0) != sizeof(bytes)) throw std::runtime_error("the system has no random numbers");
  std::string text;
  for (const unsigned char byte : bytes) {
    text += "0123456789abcdef"[byte >> 4];
    text += "0123456789abcdef"[byte & 15];
  }
  return text;
}

}  // namespace

std::string ReadToken(const std::string& path) {
  std::ifstream file(path);
  std::string token;
  if (!(file >> token))
    throw std::runtime_error("token file " + path + " cannot be read or is empty: copy it from the hub's host");
  if (token.size() < kMinLength || token.size() > kMaxLength) {
    throw std::runtime_error("token file " + path + ": a token has " + std::to_string(kMinLength) + " to " +
                             std::to_string(kMaxLength) + " characters, this one " + std::to_string(token.size()));
  }
  struct stat status {};
  if (stat(path.c_str(), &status) == 0 && S_ISREG(status.st_mode) && (status.st_mode & 077) != 0)
    spdlog::warn("token file {} is open to other users of this host: chmod 600 {}", path, path);
  return token;
}

std::string ReadOrMakeToken(const std::string& path, bool* made) {
  *made = false;
  if (access(path.c_str(), F_OK) == 0) return ReadToken(path);
  // Written aside and linked, so that nobody ever reads half of it.
  const std::string aside = path + "." + std::to_string(getpid());
  const auto fail = [&](int error) {
    unlink(aside.c_str());
    throw std::runtime_error("token file " + path + " cannot be made: " + std::strerror(error));
  };
  const int fd = open(aside.c_str(), O_WRONLY | O_CREAT | O_EXCL | O_CLOEXEC, 0600);
  if (fd < 0) fail(errno);
  const std::string line = RandomHex() + "\n";
  const bool written = write(fd, line.data(), line.size()) == static_cast<ssize_t>(line.size()) && fsync(fd) == 0;
  const int error = errno;
  close(fd);
  if (!written) fail(error);
  if (link(aside.c_str(), path.c_str()) == 0)
    *made = true;
  else if (errno != EEXIST)
    fail(errno);
  unlink(aside.c_str());
  return ReadToken(path);
}

bool TokensAreEqual(std::string_view a, std::string_view b) {
  if (a.size() != b.size()) return false;
  volatile unsigned char difference = 0;
  for (size_t i = 0; i < a.size(); ++i)
    difference = static_cast<unsigned char>(difference | (static_cast<unsigned char>(a[i] ^ b[i])));
  return difference == 0;
}

}  // namespace mapmend
