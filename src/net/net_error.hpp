#pragma once

#include <cstdint>
#include <string>
#include <utility>

#include "proto/control/link.hpp"

namespace gimnet::net {

/// The kinds of failure of an address, a dial or a handshake.
enum class Fault : std::uint8_t {
  bad_address,
  no_host,        ///< its name is not known
  no_peer,        ///< nobody answers there, or not for long
  not_permitted,  ///< by this machine
  no_memory,      ///< nor descriptors, nor threads
  timeout,
  cancelled,
  protocol,     ///< the peer is no hub, or not one that can be understood
  bad_version,  ///< of the peer's protocol
  refused,      ///< by the peer, with a GOODBYE
};

/// A failed step: its kind and, for people, what happened, to what, and what to do. A value type.
struct NetError {
  NetError(Fault what, std::string words) : fault(what), sentence(std::move(words)) {}

  Fault fault;
  std::string sentence;
  bool nobody_listens = false;  ///< at the address: the hub's process is gone
  proto::GoodbyeCode goodbye = proto::GoodbyeCode::done;  ///< of Fault::refused
};

}  // namespace gimnet::net
