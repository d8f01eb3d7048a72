#pragma once

#include <optional>
#include <string>
#include <vector>

namespace mapmend {

// Names of what is written of the picture of the ground, but for its tiles.
const std::vector<std::string>& PictureFiles();

// The folder of results of one run, held by a lock for as long as this object lives.
class OutFolder {
 public:
  // Makes the folder. An earlier map in it, or what waits in an outbox, is refused unless overwrite or append is set; a
  // map.db without a keyframe is no map. overwrite removes what an earlier run has written there, and nothing else.
  // Throws std::runtime_error with one line: not writable, in use by another run, not empty.
  OutFolder(const std::string& path, bool overwrite, bool append);
  ~OutFolder();
  OutFolder(const OutFolder&) = delete;
  OutFolder& operator=(const OutFolder&) = delete;

 private:
  int fd_ = -1;
};

// A port of this host on which nobody listens, kept from other runs that look for one as long as this object lives.
class FreePort {
 public:
  // From first on; with `only`, first or nothing. Throws std::runtime_error naming the port and the option if there is
  // none.
  FreePort(int first, bool only, const std::string& option);
  ~FreePort();
  FreePort(const FreePort&) = delete;
  FreePort& operator=(const FreePort&) = delete;
  int Port() const { return port_; }

 private:
  int port_ = 0, claim_ = -1;
};

// The port of a live page, by the option --port: that one or nothing, 0: no page; without the option a free one from
// 8080 on.
class LivePagePort {
 public:
  // Throws as FreePort does.
  explicit LivePagePort(const std::optional<int>& wanted) {
    constexpr int kFirst = 8080;
    if (wanted != 0) page_.emplace(wanted.value_or(kFirst), wanted.has_value(), "--port");
  }
  // 0: there is no page.
  int Port() const { return page_ ? page_->Port() : 0; }

 private:
  std::optional<FreePort> page_;
};

}  // namespace mapmend
