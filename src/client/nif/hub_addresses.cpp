#include "client/nif/hub_addresses.hpp"

#include <algorithm>
#include <string>
#include <utility>

#include "client/nif/platform.hpp"

namespace gimnet::nif {
namespace {

std::string_view without_spaces(std::string_view text) {
  const std::size_t begin = std::min(text.find_first_not_of(' '), text.size());
  return text.substr(begin, text.find_last_not_of(' ') + 1 - begin);
}

/// The first URL of a list, which it takes off. A comma separates two where a scheme follows, so
/// that the path of a Unix socket may have one.
std::string_view take_first(std::string_view& list) {
  std::size_t end = list.find(',');
  for (; end != std::string_view::npos; end = list.find(',', end + 1)) {
    const std::string_view next = without_spaces(list.substr(end + 1));
    if (next.starts_with("tcp:") || next.starts_with("unix:")) break;
  }
  const std::string_view first = list.substr(0, end);
  list = end == std::string_view::npos ? std::string_view{} : list.substr(end + 1);
  return without_spaces(first);
}

}  // namespace

Result<std::vector<net::Address>, Failure> hub_addresses(std::string_view url) {
  const std::string chosen = url.empty() ? environment("GIMNET_HUB") : std::string(url);
  std::vector<net::Address> addresses;
  for (std::string_view rest = chosen; !rest.empty();) {
    auto parsed = net::parse_address(take_first(rest));
    if (!parsed || addresses.size() == kHubsMax) {
      Failure failure = parsed ? Failure{NIF_BAD_ARGUMENT, "more than " + std::to_string(kHubsMax) +
                                                               " hubs are named; name fewer"}
                               : failure_of(parsed.error());
      if (url.empty()) failure.sentence += " (that is GIMNET_HUB)";
      return failure;
    }
    addresses.push_back(std::move(*parsed));
  }
  if (!addresses.empty()) return addresses;
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
  if (hub.empty()) {
    if (!asked_for) return std::optional<net::ProxyAddress>{};
    return Failure{NIF_BAD_ARGUMENT,
                   "cannot use a proxy without the URL of the hub behind it: give tcp://host:port, "
                   "too"};
  }
  const auto addresses = hub_addresses(url);
  if (!addresses) return addresses.error();
  const auto is_tcp = [](const net::Address& each) {
    return each.scheme == net::Address::Scheme::tcp;
  };
  const auto first = std::ranges::find_if(*addresses, is_tcp);
  if (!asked_for && first == addresses->end()) return std::optional<net::ProxyAddress>{};
  auto parsed = net::proxy_towards(first == addresses->end() ? addresses->front() : *first, chosen);
  if (!parsed) {
    return Failure{NIF_BAD_ARGUMENT,
                   parsed.error().sentence + (asked_for ? "" : " (that is GIMNET_PROXY)")};
  }
  return std::optional(std::move(*parsed));
}

}  // namespace gimnet::nif
