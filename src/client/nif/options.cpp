#include "client/nif/options.hpp"

#include <algorithm>
#include <cstring>
#include <string>
#include <utility>

#include "client/nif/platform.hpp"
#include "client/nif/sized_struct.hpp"
#include "proto/control/fields.hpp"
#include "proto/control/names.hpp"

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

namespace {

Failure bad(const std::string& why) { return {NIF_BAD_ARGUMENT, "cannot connect: " + why}; }

std::optional<Failure> read_identity(const nif_options& given, Options& options) {
  if (given.name != nullptr) options.name = given.name;
  if (given.description != nullptr) options.description = given.description;
  if (options.description.size() > proto::kDescriptionBytesMax) {
    return bad("the description is over " + std::to_string(proto::kDescriptionBytesMax) + " bytes");
  }
  const char* fault = options.name.empty() ? nullptr : proto::node_name_fault(options.name);
  if (fault != nullptr) {
    return Failure{NIF_BAD_NAME, "cannot connect as '" + options.name + "': " + std::string(fault)};
  }
  if (given.resume > NIF_RESUME_ON) return bad("resume is not a nif_resume");
  options.resume = given.resume == NIF_RESUME_ON ||
                   (given.resume == NIF_RESUME_DEFAULT && !options.name.empty());
  if (given.shard_plus_one > 0)
    options.shard = static_cast<std::uint16_t>(given.shard_plus_one - 1);
  return std::nullopt;
}

std::optional<Failure> read_limits(const nif_options& given, Options& options) {
  if (given.send_queue_bytes != 0) options.send.queue_bytes = given.send_queue_bytes;
  if (given.resume_bytes != 0) options.send.retained_bytes = given.resume_bytes;
  if (given.last_message_bytes > LastMessages::kBytesMax) {
    return bad("last_message_bytes is over 64 MiB, which all services of a handle have together");
  }
  if (given.last_message_bytes != 0) options.last_message_bytes = given.last_message_bytes;
  if (given.receive_queue_bytes != 0) options.receive_queue_bytes = given.receive_queue_bytes;
  if (given.message_bytes_max > NIF_MESSAGE_BYTES_MAX)
    return bad("message_bytes_max is over 1 GiB");
  if (given.message_bytes_max != 0) {
    options.reassembly.message_bytes_max = static_cast<std::uint32_t>(given.message_bytes_max);
  }
  options.reassembly.waiting_bytes_max = std::max<std::uint64_t>(
      options.reassembly.waiting_bytes_max, options.reassembly.message_bytes_max);
  if (given.reassembly_bytes != 0) options.reassembly.waiting_bytes_max = given.reassembly_bytes;
  if (options.reassembly.waiting_bytes_max < options.reassembly.message_bytes_max) {
    return bad("reassembly_bytes is smaller than message_bytes_max");
  }
  if (given.socket_receive_bytes > INT32_MAX || given.socket_send_bytes > INT32_MAX) {
    return bad("a socket buffer is over 2 GiB");
  }
  options.dialling.socket.receive_bytes = given.socket_receive_bytes;
  if (given.socket_send_bytes != 0) options.dialling.socket.send_bytes = given.socket_send_bytes;
  return std::nullopt;
}

}  // namespace

Result<Options, Failure> read_options(const nif_options* options) {
  nif_options given{};
  if (options == nullptr) options = &given;
  if (options != &given) {
    if (auto failure = read_struct(options, given, "connect", "nif_options"))
      return std::move(*failure);
    given = *options;
  }
  Options checked;
  if (auto failure = read_identity(given, checked)) return std::move(*failure);
  if (auto failure = read_limits(given, checked)) return std::move(*failure);
  if (given.connect_timeout_ms != 0) checked.connect_timeout_ms = given.connect_timeout_ms;
  checked.administrator = given.administrator != 0;
  checked.wait_for_hub = given.wait_for_hub != 0;
  checked.reconnect = given.no_reconnect == 0;
  checked.dials_to_resume = !checked.reconnect && given.resume == NIF_RESUME_ON;
  checked.keep_token = given.no_token_file == 0;
  checked.callback = given.callback;
  checked.user = given.user;
  checked.credit_by_program = given.credit_by_program != 0;
  auto addresses = hub_addresses(given.url != nullptr ? given.url : "");
  if (!addresses) return addresses.error();
  checked.addresses = std::move(*addresses);
  auto proxy = proxy_to_hub(given.proxy, given.url != nullptr ? given.url : "");
  if (!proxy) return proxy.error();
  checked.dialling.proxy = std::move(*proxy);
  return checked;
}

}  // namespace gimnet::nif
