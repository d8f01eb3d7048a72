#include "libs/bus/bus.h"

#include <spdlog/spdlog.h>

#include <algorithm>
#include <atomic>
#include <charconv>
#include <csignal>
#include <cstdlib>
#include <stdexcept>

#include "libs/bus/access_token.h"
#include "libs/bus/lcm_transport.h"
#include "libs/bus/tcp_link.h"

namespace mapmend {
namespace {

bool IsChannelText(const std::string& text) {
  return std::all_of(text.begin(), text.end(),
                     [](char c) { return std::isalnum(static_cast<unsigned char>(c)) || c == '_'; });
}

[[noreturn]] void RefuseUrl(const std::string& url) {
  throw std::runtime_error("LCM URL '" + url +
                           "': expected tcpq://HOST:PORT, udpm://GROUP:PORT?ttl=0, memq:// or file://LOG");
}

// HOST and PORT may be left out.
TcpLinkOptions ParseTcpUrl(const std::string& url) {
  TcpLinkOptions options;
  std::string rest = url.substr(url.find("://") + 3);
  rest = rest.substr(0, rest.find('?'));
  const size_t colon = rest.find(':');
  if (colon != 0 && !rest.empty()) options.host = rest.substr(0, colon);
  if (colon != std::string::npos) {
    const char* end = rest.data() + rest.size();
    const auto [parsed, error] = std::from_chars(rest.data() + colon + 1, end, options.port);
    if (error != std::errc() || parsed != end || options.port < 1 || options.port > 65535) RefuseUrl(url);
  }
  if (const char* token = std::getenv(kTokenEnvironment); token != nullptr) options.token = token;
  return options;
}

std::shared_ptr<Transport> MakeTransport(const std::string& url) {
  const size_t colon = url.find("://");
  const std::string scheme = url.substr(0, colon);
  if (colon == std::string::npos) RefuseUrl(url);
  if (scheme == "tcpq") return std::make_shared<TcpLink>(ParseTcpUrl(url));
  if (scheme == "udpm" || scheme == "memq" || scheme == "file") return std::make_shared<LcmTransport>(url);
  RefuseUrl(url);
}

}  // namespace

std::string ResolveLcmUrl(const std::string& argument) {
  if (!argument.empty()) return argument;
  const char* environment = std::getenv("LCM_DEFAULT_URL");
  return environment != nullptr && *environment != '\0' ? environment : "tcpq://127.0.0.1:7700";
}

struct Bus::Impl {
  std::string prefix;
  std::atomic<int64_t> num_refused{0};
  std::shared_ptr<Transport> transport;  // subscriptions look whether it is still there
};

Bus::Bus(const std::string& url, const std::string& channel_prefix) : impl_(std::make_unique<Impl>()) {
  if (!IsChannelText(channel_prefix) || channel_prefix.size() > 32) {
    throw std::runtime_error("channel prefix '" + channel_prefix + "': only letters, digits and _, at most 32");
  }
  std::signal(SIGPIPE, SIG_IGN);
  impl_->prefix = channel_prefix;
  impl_->transport = MakeTransport(url);
}

Bus::~Bus() = default;

Subscription Bus::SubscribeRaw(const std::string& channel, Delivery delivery, RawHandler handler) {
  auto subscriber =
      std::make_shared<Subscriber>(impl_->prefix + channel, delivery, std::move(handler),
                                   [this, channel](const std::string& what) { CountRefused(channel, what); });
  impl_->transport->Add(subscriber);
  return Subscription(std::move(subscriber), impl_->transport);
}

bool Bus::PublishRaw(const std::string& channel, const uint8_t* data, int size) {
  return impl_->transport->Publish(impl_->prefix + channel, data, size);
}

int Bus::Handle(int timeout_ms) { return impl_->transport->Handle(timeout_ms); }

bool Bus::IsConnected() const { return impl_->transport->IsConnected(); }

int64_t Bus::ConnectionNumber() const { return impl_->transport->ConnectionNumber(); }

int64_t Bus::NumRefused() const { return impl_->num_refused; }

void Bus::CountRefused(const std::string& channel, const std::string& what) {
  const int64_t count = ++impl_->num_refused;
  if (count <= 10 || count % 1000 == 0) spdlog::warn("{}: message refused ({} in all): {}", channel, count, what);
}

}  // namespace mapmend
