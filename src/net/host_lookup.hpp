#pragma once

#include <cstdint>
#include <functional>
#include <string>
#include <vector>

#include "base/result.hpp"
#include "net/address.hpp"
#include "net/wait.hpp"

namespace gimnet::net {

/// One address of a host, as connect() takes it: a sockaddr.
using HostAddress = std::vector<std::byte>;

struct HostAddresses {
  std::string fault;  ///< why there is none; "": there are
  std::vector<HostAddress> found;
};

/// Asks for all addresses of host and port; may take as long as it likes. Called on a thread of its
/// own.
using HostLookup = std::function<HostAddresses(const std::string& host, std::uint16_t port)>;

/// Lookups of this process that may be under way. A name server that does not answer holds each for
/// some seconds.
inline constexpr int kHostLookupsMax = 16;

/// Finds all addresses of a host; a Unix socket has one, its path. Gives up at the deadline or when
/// `cancel` is raised: the system cannot be told to leave its search for a name, so that goes on
/// without anybody, on a thread of its own, and is thrown away. Thread safety: any thread. Errors:
/// Fault::no_host, Fault::timeout, Fault::cancelled, Fault::no_memory.
[[nodiscard]] Result<std::vector<HostAddress>, NetError> find_addresses(const Address& address,
                                                                        Deadline deadline,
                                                                        const WakeSignal& cancel);
/// The same with another way to look. REQUIRES: a TCP address.
[[nodiscard]] Result<std::vector<HostAddress>, NetError> find_addresses(const Address& address,
                                                                        Deadline deadline,
                                                                        const WakeSignal& cancel,
                                                                        const HostLookup& lookup);

}  // namespace gimnet::net
