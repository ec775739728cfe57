#pragma once

#include <cstddef>
#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "base/result.hpp"
#include "client/nif/error.hpp"
#include "client/nif/last_messages.hpp"
#include "client/nif/send_queue.hpp"
#include "gimnet/nif.h"
#include "net/address.hpp"
#include "net/dial.hpp"
#include "proto/frame/reassembler.hpp"

namespace gimnet::nif {

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
