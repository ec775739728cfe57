#pragma once

#include <cstdint>
#include <functional>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "base/result.hpp"
#include "client/nif/error.hpp"
#include "client/nif/options.hpp"
#include "client/nif/session_terms.hpp"
#include "net/address.hpp"
#include "net/dial.hpp"
#include "proto/control/link.hpp"

namespace gimnet::nif {

/// The dials after a node's connection broke: whether there are any, to which hubs, how long.
/// Time is an argument. Thread safety: the library's thread (before it starts: the connecting one).
class DialPlan {
 public:
  /// The longest try of a reconnect.
  static constexpr std::int64_t kTryNs = 5'000'000'000;
  /// So long after a break the former hub alone is dialled: there the session can go on.
  static constexpr std::int64_t kFormerHubNs = 1'000'000'000;

  explicit DialPlan(const Options& options)
      : reconnect_(options.reconnect),
        dials_to_resume_(options.dials_to_resume),
        addresses_(options.addresses) {}

  /// All hubs; the one that admitted the node last comes first.
  [[nodiscard]] std::span<const net::Address> all() const { return addresses_; }
  /// The hub at this URL admitted the node.
  void admitted(const std::string& url);
  /// The connection has lasted: what broke it is not dialled in a tight loop.
  void lasted() { backoff_.reset(); }

  /// The connection broke, and the hub's code says why. Nothing: the library dials again.
  /// Otherwise the answer of all calls from now on.
  [[nodiscard]] std::optional<Failure> broke(const std::string& why, proto::GoodbyeCode code,
                                             const SessionTerms& session, std::int64_t now_ns);
  /// Only a connection that takes the session up again counts.
  [[nodiscard]] bool resumes_only() const { return resumes_only_; }
  /// The time to wait before the next try. `random`: any 64 random bits.
  [[nodiscard]] std::int64_t wait_ns(std::uint64_t random) { return backoff_.next_ns(random); }
  /// The hubs to dial now, in this order, and until when.
  [[nodiscard]] std::span<const net::Address> addresses(std::int64_t now_ns) const;
  [[nodiscard]] Deadline deadline(std::int64_t now_ns) const;
  /// A dial failed. True: another may help.
  [[nodiscard]] bool dials_again(const Failure& failure, std::int64_t now_ns) const;

 private:
  /// The hub keeps the session, and this node may dial to take it up again.
  [[nodiscard]] bool may_resume(proto::GoodbyeCode code, const SessionTerms& session) const;

  const bool reconnect_;
  const bool dials_to_resume_;
  std::vector<net::Address> addresses_;
  net::DialBackoff backoff_;
  bool hub_ends_ = false;      ///< the last hub said so
  bool resumes_only_ = false;  ///< the next connection has to resume the session ...
  std::int64_t broke_ns_ = 0;  ///< ... whose last one broke then
  std::int64_t grace_ns_ = 0;  ///< ... and which the hub keeps so long
};

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
