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

}  // namespace gimnet::nif
