#pragma once

#include <string>

// What can be known of a run from its folder.
namespace mapmend {

// Whether a launcher works in the folder: it holds a lock on it as long as it lives.
bool IsRunning(const std::string& folder);

// How a run that is not running has ended, in one line for a person: "the run in demo has ended: one piece, 162 of 162
// frames in the map; report demo/report.html". Throws std::runtime_error if the folder is not that of a run.
std::string DescribeEnd(const std::string& folder);

// The address of a run's bus, in OUT/logs/lcm-url for as long as the object lives: a later run may have the same one.
class BusAddressFile {
 public:
  BusAddressFile(const std::string& out, const std::string& url);
  ~BusAddressFile();
  BusAddressFile(const BusAddressFile&) = delete;
  BusAddressFile& operator=(const BusAddressFile&) = delete;

 private:
  std::string path_;
};

// Throws std::runtime_error if there is none.
std::string ReadBusAddress(const std::string& out);

}  // namespace mapmend
