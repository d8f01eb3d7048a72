#pragma once

#include <string>

namespace mapmend {

// The folder of results of one run, held by a lock for as long as this object lives.
class OutFolder {
 public:
  // Makes the folder. An earlier map.db in it is refused unless overwrite or append is set; overwrite removes what an earlier run
  // has written there, and nothing else. Throws std::runtime_error with one line: not writable, in use by another run, not empty.
  OutFolder(const std::string& path, bool overwrite, bool append);
  ~OutFolder();
  OutFolder(const OutFolder&) = delete;
  OutFolder& operator=(const OutFolder&) = delete;

 private:
  int fd_ = -1;
};

// A port of this host on which nobody listens, from first on. With `only`, first or nothing. Throws std::runtime_error
// naming the port and the option if there is none.
int FindFreePort(int first, bool only, const std::string& option);

}  // namespace mapmend
