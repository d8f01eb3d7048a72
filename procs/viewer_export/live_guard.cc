#include "procs/viewer_export/live_guard.h"

#include <arpa/inet.h>
#include <fcntl.h>
#include <linux/openat2.h>
#include <sys/stat.h>
#include <sys/syscall.h>
#include <unistd.h>

#include <algorithm>
#include <cctype>

namespace mapmend {
namespace {

std::string Lower(std::string text) {
  std::transform(text.begin(), text.end(), text.begin(), [](unsigned char c) { return std::tolower(c); });
  return text;
}

// "name:80" and "[::1]:80" without the port.
std::string WithoutPort(const std::string& host) {
  if (host.starts_with("[")) return host.substr(1, host.find(']') == std::string::npos ? 0 : host.find(']') - 1);
  return host.substr(0, host.find(':'));
}

bool IsAddress(const std::string& host) {
  in6_addr address{};
  return inet_pton(AF_INET, host.c_str(), &address) == 1 || inet_pton(AF_INET6, host.c_str(), &address) == 1;
}

}  // namespace

std::vector<std::string> OwnHostNames() {
  char name[256] = "";
  if (gethostname(name, sizeof(name) - 1) != 0 || name[0] == '\0') return {};
  const std::string full = Lower(name), first = full.substr(0, full.find('.'));
  return {full, first, first + ".local"};
}

std::string CheckHostAndOrigin(const httplib::Request& request, const std::vector<std::string>& own_names) {
  if (request.get_header_value_count("Host") > 1) return "The request names two hosts.\n";
  const std::string host = Lower(request.get_header_value("Host"));
  if (host.empty()) return request.version == "HTTP/1.0" ? "" : "The request names no host.\n";
  const std::string name = WithoutPort(host);
  if (!IsAddress(name) && name != "localhost" &&
      std::find(own_names.begin(), own_names.end(), name) == own_names.end()) {
    return "This page is not served under that name: use the address of this host.\n";
  }
  if (!request.has_header("Origin")) return "";
  const std::string origin = Lower(request.get_header_value("Origin"));
  return origin == "http://" + host || origin == "https://" + host ? "" : "Pages of other sites may not ask here.\n";
}

int OpenBelow(const std::string& folder, const std::string& path, int64_t* size) {
  if (path.empty() || path.find('\0') != std::string::npos || path.ends_with(".token")) return -1;
  const int root = open(folder.c_str(), O_PATH | O_DIRECTORY | O_CLOEXEC);
  if (root < 0) return -1;
  open_how how{};
  how.flags = O_RDONLY | O_CLOEXEC | O_NONBLOCK;  // a pipe must not wait for its writer
  how.resolve = RESOLVE_BENEATH | RESOLVE_NO_MAGICLINKS;
  const int fd = static_cast<int>(syscall(SYS_openat2, root, path.c_str(), &how, sizeof(how)));
  struct stat status {
  }, of_root{};
  const bool known = fd >= 0 && fstat(fd, &status) == 0 && fstat(root, &of_root) == 0;
  close(root);
  const bool is_private = (status.st_mode & 077) == 0 && (of_root.st_mode & 077) != 0;
  if (known && S_ISREG(status.st_mode) && !is_private) {
    *size = status.st_size;
    return fd;
  }
  if (fd >= 0) close(fd);
  return -1;
}

}  // namespace mapmend
