#include "net/host_lookup.hpp"

#include <netdb.h>
#include <sys/socket.h>
#include <sys/un.h>

#include <algorithm>
#include <atomic>
#include <cstddef>
#include <cstring>
#include <exception>
#include <memory>
#include <optional>
#include <span>
#include <system_error>
#include <thread>
#include <utility>

#include "base/mutex.hpp"
#include "base/signals_blocked.hpp"

namespace gimnet::net {
namespace {

constinit std::atomic<int> g_lookups{0};

HostAddress socket_address(const std::string& path) {
  sockaddr_un address{};
  static_assert(sizeof address.sun_path == kSocketPathMax + 1);
  address.sun_family = AF_UNIX;
  std::memcpy(address.sun_path, path.data(), std::min(path.size(), kSocketPathMax));
  const auto bytes = std::as_bytes(std::span(&address, 1));
  return {bytes.begin(), bytes.end()};
}

HostAddresses ask_system(const std::string& host, std::uint16_t port, int flags) {
  addrinfo hints{};
  hints.ai_family = AF_UNSPEC;
  hints.ai_socktype = SOCK_STREAM;
  hints.ai_flags = flags;
  addrinfo* first = nullptr;
  const int error = ::getaddrinfo(host.c_str(), std::to_string(port).c_str(), &hints, &first);
  if (error != 0) return {::gai_strerror(error), {}};
  const std::unique_ptr<addrinfo, decltype(&::freeaddrinfo)> owner(first, &::freeaddrinfo);
  HostAddresses addresses;
  for (const addrinfo* at = first; at != nullptr; at = at->ai_next) {
    const auto* bytes = reinterpret_cast<const std::byte*>(at->ai_addr);
    addresses.found.emplace_back(bytes, bytes + at->ai_addrlen);
  }
  if (addresses.found.empty()) addresses.fault = "it has no address";
  return addresses;
}

/// One search, which belongs to who asked and to the thread that looks; whoever is last frees it.
class Search {
 public:
  Search() { g_lookups.fetch_add(1, std::memory_order_relaxed); }  // a number by itself
  ~Search() { g_lookups.fetch_sub(1, std::memory_order_relaxed); }
  Search(const Search&) = delete;
  Search& operator=(const Search&) = delete;

  [[nodiscard]] const WakeSignal& ended() const { return ended_; }
  void end(HostAddresses addresses) GIMNET_EXCLUDES(mutex_) {
    const MutexLock lock(mutex_);
    addresses_ = std::move(addresses);
    ended_.raise();
  }
  [[nodiscard]] std::optional<HostAddresses> take() GIMNET_EXCLUDES(mutex_) {
    const MutexLock lock(mutex_);
    return std::exchange(addresses_, std::nullopt);
  }

 private:
  WakeSignal ended_;
  Mutex mutex_;
  std::optional<HostAddresses> addresses_ GIMNET_GUARDED_BY(mutex_);
};

NetError not_found(const Address& address, const std::string& why) {
  return {Fault::no_host, "cannot find the host of " + address.url() + ": " + why};
}

/// False: the system has no thread left.
bool begin(std::shared_ptr<Search> search, const Address& address, const HostLookup& lookup) {
  try {
    const SignalsBlocked blocked;
    std::thread([search = std::move(search), lookup, host = address.host, port = address.port] {
      try {
        search->end(lookup(host, port));
      } catch (const std::exception&) {
        search->end({"out of memory", {}});
      }
    }).detach();
  } catch (const std::system_error&) {
    return false;
  }
  return true;
}

}  // namespace

Result<std::vector<HostAddress>, NetError> find_addresses(const Address& address, Deadline deadline,
                                                          const WakeSignal& cancel) {
  if (address.scheme == Address::Scheme::unix_socket)
    return std::vector<HostAddress>{socket_address(address.path)};
  // A number needs nobody to be asked.
  HostAddresses numeric = ask_system(address.host, address.port, AI_NUMERICHOST);
  if (numeric.fault.empty()) return std::move(numeric.found);
  return find_addresses(address, deadline, cancel, [](const std::string& host, std::uint16_t port) {
    return ask_system(host, port, 0);
  });
}

Result<std::vector<HostAddress>, NetError> find_addresses(const Address& address, Deadline deadline,
                                                          const WakeSignal& cancel,
                                                          const HostLookup& lookup) {
  if (g_lookups.load(std::memory_order_relaxed) >= kHostLookupsMax) {  // a number by itself
    return not_found(
        address, "too many searches for hosts have no answer yet; does the name server answer?");
  }
  const auto search = std::make_shared<Search>();
  if (!search->ended().valid() || !begin(search, address, lookup)) {
    return NetError{Fault::no_memory, "cannot find the host of " + address.url() +
                                          ": no descriptor or thread is left"};
  }
  for (;;) {
    const Raised raised = wait_for_either(search->ended(), cancel, deadline);
    if (raised.other)
      return NetError{Fault::cancelled, "closed while connecting to " + address.url()};
    if (raised.one) break;
    if (deadline != kNever && steady_now_ns() >= deadline) {
      return NetError{Fault::timeout, "cannot find the host of " + address.url() +
                                          " within the time given: does the name server answer?"};
    }
  }
  HostAddresses addresses = search->take().value_or(HostAddresses{"it has no address", {}});
  if (!addresses.fault.empty()) return not_found(address, addresses.fault);
  return std::move(addresses.found);
}

}  // namespace gimnet::net
