#pragma once

#include <cstddef>
#include <cstdint>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "base/result.hpp"
#include "client/nif/error.hpp"
#include "client/nif/last_messages.hpp"
#include "client/nif/send_queue.hpp"
#include "gimnet/nif.h"
#include "net/address.hpp"
#include "net/dial.hpp"
#include "net/proxy_address.hpp"
#include "proto/frame/reassembler.hpp"

namespace gimnet::nif {

inline constexpr std::size_t kHubsMax = 16;

/// The addresses to try, in this order: those of `url` if not empty, separated by commas, else
/// those of GIMNET_HUB of the environment, else the user's default Unix socket (left out where its
/// folder is missing or another user's) and then tcp://127.0.0.1:7450. Errors: NIF_BAD_ARGUMENT.
[[nodiscard]] Result<std::vector<net::Address>, Failure> hub_addresses(std::string_view url);

/// The proxy to dial the hub through: `proxy`, or GIMNET_PROXY of the environment if that is null.
/// The environment's is left out where no `url` and no GIMNET_HUB names a hub by tcp://. `url`: as
/// above. Errors: NIF_BAD_ARGUMENT.
[[nodiscard]] Result<std::optional<net::ProxyAddress>, Failure> proxy_to_hub(const char* proxy,
                                                                             std::string_view url);

/// nif_options, checked and with the defaults filled in. A value type.
struct Options {
  std::vector<net::Address> addresses;
  std::string name;
  std::string description;
  std::int32_t connect_timeout_ms = 5'000;
  bool wait_for_hub = false;
  bool reconnect = true;
  bool dials_to_resume = false;  ///< without reconnect: dials where the session can be resumed
  bool resume = false;
  bool keep_token = true;  ///< over a crash; of nodes with a name only
  bool administrator = false;
  std::optional<std::uint16_t> shard;
  SendQueue::Limits send;
  std::size_t last_message_bytes = LastMessages::kMessageBytesDefault;
  std::size_t receive_queue_bytes = 16 * 1024 * 1024;
  proto::ReassemblyLimits reassembly{.message_bytes_max = 64u << 20,
                                     .waiting_bytes_max = 64u << 20};
  net::DialOptions dialling{.socket = {.receive_bytes = 0, .send_bytes = 256 * 1024}};
  nif_callback callback = nullptr;
  void* user = nullptr;
  bool credit_by_program = false;
};

/// `options` may be null. Errors: NIF_BAD_ARGUMENT, NIF_BAD_NAME.
[[nodiscard]] Result<Options, Failure> read_options(const nif_options* options);

}  // namespace gimnet::nif
