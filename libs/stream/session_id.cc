#include "libs/stream/session_id.h"

#include <cstdint>
#include <cstdio>
#include <fstream>
#include <stdexcept>

namespace mapmend {
namespace {

// FNV-1a, 64 bit (Fowler, Noll, Vo).
uint64_t Fnv1a(const std::string& text, uint64_t hash) {
  for (const unsigned char c : text) hash = (hash ^ c) * 0x100000001b3ULL;
  return hash;
}

}  // namespace

std::string SessionIdFromText(const std::string& text) {
  const uint64_t high = Fnv1a(text, 0xcbf29ce484222325ULL), low = Fnv1a(text, high);
  char uuid[37];
  std::snprintf(uuid, sizeof(uuid), "%08x-%04x-8%03x-%04x-%012llx", static_cast<unsigned>(high >> 32),
                static_cast<unsigned>(high >> 16 & 0xffff), static_cast<unsigned>(high & 0xfff),
                static_cast<unsigned>(0x8000 | (low >> 48 & 0x3fff)),
                static_cast<unsigned long long>(low & 0xffffffffffffULL));
  return uuid;
}

std::string NewSessionId() {
  std::ifstream file("/proc/sys/kernel/random/uuid");
  std::string uuid;
  if (!(file >> uuid))
    throw std::runtime_error("cannot make a session id: /proc/sys/kernel/random/uuid cannot be read");
  return uuid;
}

}  // namespace mapmend
