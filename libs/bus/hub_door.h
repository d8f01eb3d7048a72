#pragma once

#include <cstdint>
#include <string>
#include <vector>

namespace mapmend {

// Listens, and lets in. Descriptors are never used up without notice: as many as the system allows are asked for, and
// one is kept in reserve to turn newcomers away with when there are none left.
class HubDoor {
 public:
  // Throws std::runtime_error with one line, e.g. if the port is in use.
  HubDoor(const std::string& bind, int port);
  ~HubDoor();
  HubDoor(const HubDoor&) = delete;
  HubDoor& operator=(const HubDoor&) = delete;

  struct Guest {
    int fd;            // non-blocking; the caller's
    uint32_t address;  // IPv4, host byte order
  };
  // Those who have come, a bounded number. num_turned_away is increased by those there was no descriptor for.
  std::vector<Guest> Open(int64_t* num_turned_away);

  int fd() const { return listener_; }
  int port() const { return port_; }

 private:
  int listener_ = -1, reserve_ = -1, port_ = 0;
};

// How many descriptors this process may have, after asking the system for as many as it allows.
int RaiseDescriptorLimit();

}  // namespace mapmend
