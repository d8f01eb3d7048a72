#include "procs/mapmend/out_folder.h"

#include <SQLiteCpp/SQLiteCpp.h>
#include <arpa/inet.h>
#include <fcntl.h>
#include <netinet/in.h>
#include <sys/file.h>
#include <sys/socket.h>
#include <sys/un.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <cstddef>
#include <cstring>
#include <filesystem>
#include <fstream>
#include <stdexcept>

#include "libs/bus/channels.h"
#include "libs/formats/map_formats.h"
#include "libs/wire/outbox.h"

namespace mapmend {
namespace {

namespace fs = std::filesystem;

// What a run writes into its folder beside the formats of libs/formats.
constexpr const char* kResults[] = {"map.db",
                                    "map.db-wal",
                                    "map.db-shm",
                                    "map.ply",
                                    "cameras.ply",
                                    "frames.tum",
                                    "keyframes.tum",
                                    "components",
                                    "submaps",
                                    "graph.dot",
                                    "graph.svg",
                                    "report.html",
                                    "summary.json",
                                    "logs",
                                    "outbox",
                                    "colmap",
                                    "trajectory.svg",
                                    "events.jsonl",
                                    "images.db",
                                    "images.db-wal",
                                    "images.db-shm",
                                    "outbox.images",
                                    "outbox.images-wal",
                                    "outbox.images-shm",
                                    "edges",
                                    "mosaic.mbtiles",
                                    "mosaic.mbtiles-wal",
                                    "mosaic.mbtiles-shm"};

// Whether a database holds anything worth keeping: a run that failed before its first keyframe leaves none. What cannot
// be read is kept.
bool HoldsMap(const std::string& path) {
  std::error_code error;
  if (!fs::exists(path, error)) return false;
  constexpr std::uintmax_t kLeastPage = 512;  // SQLite takes less for an empty database, whatever it is
  const std::uintmax_t size = fs::file_size(path, error);
  if (!error && size > 0 && size < kLeastPage) return true;
  try {
    SQLite::Database database(path, SQLite::OPEN_READWRITE);
    if (!database.tableExists("keyframe"))
      return database.execAndGet("SELECT count(*) FROM sqlite_master").getInt() > 0;
    return database.execAndGet("SELECT EXISTS(SELECT 1 FROM keyframe)").getInt() != 0;
  } catch (const SQLite::Exception&) {
    return true;
  }
}

// Whether an outbox holds keyframes that no store has acknowledged.
bool HoldsFlight(const std::string& path) {
  std::error_code error;
  if (!fs::exists(path, error)) return false;
  const Outbox outbox(path);
  if (outbox.Empty()) return false;
  for (int64_t seq = outbox.FirstSeq(); seq <= outbox.LastSeq(); ++seq) {
    const auto record = outbox.Read(seq);
    if (!record || record->channel == channels::kKeyframe) return true;
  }
  return false;
}

// 0 if a server may listen there, else errno.
int WhyNotFree(int port) {
  const int fd = socket(AF_INET, SOCK_STREAM | SOCK_CLOEXEC, 0);
  if (fd < 0) return errno;
  const int yes = 1;  // a port whose last connections are in TIME_WAIT is free, as it is for the servers themselves
  setsockopt(fd, SOL_SOCKET, SO_REUSEADDR, &yes, sizeof(yes));
  sockaddr_in address{};
  address.sin_family = AF_INET;
  address.sin_port = htons(static_cast<uint16_t>(port));
  address.sin_addr.s_addr = htonl(INADDR_LOOPBACK);
  const bool free = bind(fd, reinterpret_cast<const sockaddr*>(&address), sizeof(address)) == 0 && listen(fd, 1) == 0;
  const int error = free ? 0 : errno;
  close(fd);
  return error;
}

// A name in the kernel's list of abstract sockets that only one process at a time can hold: between the moment a run
// finds a port free and the moment its server listens there, no other run must find it free. -1 if it is held.
int Claim(int port) {
  const int fd = socket(AF_UNIX, SOCK_DGRAM | SOCK_CLOEXEC, 0);
  if (fd < 0) return -1;
  sockaddr_un address{};
  address.sun_family = AF_UNIX;
  const std::string name = "mapmend-port-" + std::to_string(port);
  std::memcpy(address.sun_path + 1, name.data(), name.size());
  const auto size = static_cast<socklen_t>(offsetof(sockaddr_un, sun_path) + 1 + name.size());
  if (bind(fd, reinterpret_cast<const sockaddr*>(&address), size) == 0) return fd;
  close(fd);
  return -1;
}

void RemoveResults(const std::string& path) {
  std::vector<std::string> names(std::begin(kResults), std::end(kResults));
  names.insert(names.end(), PictureFiles().begin(), PictureFiles().end());
  for (const MapFormat& format : MapFormats()) names.insert(names.end(), format.files.begin(), format.files.end());
  for (const std::string& name : names) {
    std::error_code error;
    fs::remove_all(fs::path(path) / name, error);
    if (error) throw std::runtime_error("cannot remove " + (fs::path(path) / name).string() + ": " + error.message());
  }
}

}  // namespace

const std::vector<std::string>& PictureFiles() {
  static const std::vector<std::string> files = {"mosaic.tif",  "surface.tif", "mosaic.png", "coverage.png",
                                                 "mosaic.json", "mosaic.kml",  "mosaic.kmz"};
  return files;
}

OutFolder::OutFolder(const std::string& path, bool overwrite, bool append) {
  std::error_code error;
  fs::create_directories(path, error);
  if (error || !fs::is_directory(path)) {
    throw std::runtime_error("cannot write to --out " + path + ": " + (error ? error.message() : "not a folder"));
  }
  const std::string probe = (fs::path(path) / (".mapmend-" + std::to_string(getpid()))).string();
  if (!std::ofstream(probe)) throw std::runtime_error("cannot write to --out " + path + ": " + std::strerror(errno));
  fs::remove(probe, error);

  fd_ = open(path.c_str(), O_RDONLY | O_DIRECTORY | O_CLOEXEC);
  if (fd_ < 0 || flock(fd_, LOCK_EX | LOCK_NB) != 0) {
    if (fd_ >= 0) close(fd_);
    throw std::runtime_error("another mapmend is writing into " + path + "; choose another --out");
  }
  try {
    if (!overwrite && !append && HoldsFlight((fs::path(path) / "outbox").string())) {
      throw std::runtime_error(path + " holds records of a flight that was cut off: `mapmend recover " + path +
                               "` makes their map, --continue goes on with the flight, --overwrite gives it up");
    }
    if (!overwrite && !append && HoldsMap((fs::path(path) / "map.db").string())) {
      throw std::runtime_error(
          path +
          " already holds a map.db: give another --out, --overwrite to replace it, or --append to map "
          "this flight into it");
    }
    if (!append) RemoveResults(path);
    fs::create_directories(fs::path(path) / "logs", error);
    if (error) throw std::runtime_error("cannot write to --out " + path + ": " + error.message());
  } catch (...) {
    close(fd_);
    throw;
  }
}

OutFolder::~OutFolder() { close(fd_); }

FreePort::FreePort(int first, bool only, const std::string& option) {
  if (first < 1 || first > 65535)
    throw std::runtime_error(option + " " + std::to_string(first) + ": ports are 1 to 65535");
  for (int port = first; port <= (only ? first : std::min(65535, first + 99)); ++port) {
    claim_ = Claim(port);
    const int error = claim_ >= 0 ? WhyNotFree(port) : EADDRINUSE;
    if (error == 0) {
      port_ = port;
      return;
    }
    if (claim_ >= 0) close(claim_);
    if (only && error != EADDRINUSE) {
      throw std::runtime_error(option + " " + std::to_string(first) + ": " + std::strerror(error) +
                               (error == EACCES ? " (ports below 1024 belong to root)" : "") + "; choose another");
    }
  }
  throw std::runtime_error(only ? option + " " + std::to_string(first) +
                                      ": the port is in use by another program; choose another"
                                : "no free port from " + std::to_string(first) + " on; choose one with " + option);
}

FreePort::~FreePort() { close(claim_); }

}  // namespace mapmend
