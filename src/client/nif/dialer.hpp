#pragma once

#include <functional>
#include <memory>
#include <span>
#include <string>
#include <vector>

#include "base/result.hpp"
#include "client/nif/error.hpp"
#include "client/nif/session_terms.hpp"
#include "net/dial.hpp"
#include "proto/control/link.hpp"

namespace gimnet::nif {

/// An admitted connection.
struct Admitted {
  std::unique_ptr<net::Stream> stream;
  std::string address;  ///< of the hub, as a URL
  SessionTerms session;
};

/// The token to show at an address; empty: none.
using TokenFor = std::function<std::vector<std::byte>(const std::string& address)>;

/// Connects a node, for nif_connect() and the library's thread: dials each address in turn, for its
/// share of the time, and shakes hands, until one hub admits the node, one refuses it for a reason
/// that holds at all hubs, or the time is up. Where several fail, the last failure is told.
/// `token_for` is asked where `hello` has no token; it may be empty. Errors: those of
/// net::dial_hub(); NIF_CLOSED when `cancel` was raised.
[[nodiscard]] Result<Admitted, Failure> admit(std::span<const net::Address> addresses,
                                              const net::DialOptions& options,
                                              const proto::Hello& hello, Deadline deadline,
                                              const net::WakeSignal& cancel,
                                              const TokenFor& token_for = {});

}  // namespace gimnet::nif
