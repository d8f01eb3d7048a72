#include "libs/bus/host_lookup.h"

#include <arpa/inet.h>
#include <netdb.h>
#include <sys/socket.h>

#include <cstring>
#include <mutex>
#include <thread>

namespace mapmend {

struct HostLookup::Answer {
  std::mutex mutex;
  bool done = false;
  std::vector<sockaddr_in> addresses;
  std::string error;
};

HostLookup::HostLookup(const std::string& host, int port) : answer_(std::make_shared<Answer>()) {
  sockaddr_in address{};
  address.sin_family = AF_INET;
  address.sin_port = htons(static_cast<uint16_t>(port));
  if (inet_pton(AF_INET, host.c_str(), &address.sin_addr) == 1) {
    answer_->addresses.push_back(address);
    answer_->done = true;
    return;
  }
  std::thread([answer = answer_, host, address]() mutable {
    addrinfo hints{};
    hints.ai_family = AF_INET;
    hints.ai_socktype = SOCK_STREAM;
    addrinfo* found = nullptr;
    const int error = getaddrinfo(host.c_str(), nullptr, &hints, &found);
    const std::lock_guard lock(answer->mutex);
    for (const addrinfo* it = error == 0 ? found : nullptr; it != nullptr; it = it->ai_next) {
      sockaddr_in one{};
      std::memcpy(&one, it->ai_addr, sizeof(one));
      one.sin_port = address.sin_port;
      answer->addresses.push_back(one);
    }
    if (error == 0) freeaddrinfo(found);
    if (error != 0) answer->error = "host " + host + ": " + gai_strerror(error);
    answer->done = true;
  }).detach();
}

bool HostLookup::IsDone() const {
  const std::lock_guard lock(answer_->mutex);
  return answer_->done;
}

std::vector<sockaddr_in> HostLookup::Addresses(std::string* error) const {
  const std::lock_guard lock(answer_->mutex);
  *error = answer_->error;
  return answer_->addresses;
}

}  // namespace mapmend
