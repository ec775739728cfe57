#include "client/nif/options.hpp"

#include <algorithm>
#include <cstring>

#include "client/nif/hub_addresses.hpp"
#include "client/nif/sized_struct.hpp"
#include "proto/control/fields.hpp"
#include "proto/control/names.hpp"

namespace gimnet::nif {
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
