#include "client/nif/hub_addresses.hpp"

#include <string>
#include <utility>

#include "client/nif/platform.hpp"

namespace gimnet::nif {

Result<std::vector<net::Address>, Failure> hub_addresses(std::string_view url) {
  const std::string chosen = url.empty() ? environment("GIMNET_HUB") : std::string(url);
  std::vector<net::Address> addresses;
  if (!chosen.empty()) {
    auto parsed = net::parse_address(chosen);
    if (!parsed) {
      Failure failure = failure_of(parsed.error());
      if (url.empty()) failure.sentence += " (that is GIMNET_HUB)";
      return failure;
    }
    addresses.push_back(std::move(*parsed));
    return addresses;
  }
  if (const std::string folder = runtime_folder(); !folder.empty()) {
    net::Address local;
    local.scheme = net::Address::Scheme::unix_socket;
    local.path = folder + "/tcphub.sock";
    if (local.path.size() <= net::kSocketPathMax) addresses.push_back(std::move(local));
  }
  net::Address loopback;
  loopback.host = "127.0.0.1";
  loopback.port = net::kDefaultPort;
  addresses.push_back(std::move(loopback));
  return addresses;
}

Result<std::optional<net::ProxyAddress>, Failure> proxy_to_hub(const char* proxy,
                                                               std::string_view url) {
  const bool asked_for = proxy != nullptr;
  const std::string chosen = asked_for ? proxy : environment("GIMNET_PROXY");
  if (chosen.empty()) return std::optional<net::ProxyAddress>{};
  const std::string hub = url.empty() ? environment("GIMNET_HUB") : std::string(url);
  if (!asked_for && !hub.starts_with("tcp:")) return std::optional<net::ProxyAddress>{};
  if (hub.empty()) {
    return Failure{NIF_BAD_ARGUMENT,
                   "cannot use a proxy without the URL of the hub behind it: give tcp://host:port, "
                   "too"};
  }
  const auto address = net::parse_address(hub);
  if (!address) return failure_of(address.error());
  auto parsed = net::proxy_towards(*address, chosen);
  if (!parsed) {
    return Failure{NIF_BAD_ARGUMENT,
                   parsed.error().sentence + (asked_for ? "" : " (that is GIMNET_PROXY)")};
  }
  return std::optional(std::move(*parsed));
}

}  // namespace gimnet::nif
