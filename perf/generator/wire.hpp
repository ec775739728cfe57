#pragma once

#include <cstddef>
#include <cstdint>
#include <memory>
#include <optional>
#include <span>
#include <string_view>
#include <vector>

#include "generator/client.hpp"
#include "generator/message_block.hpp"

namespace gimnet::perf {

/// To whom a message goes.
struct Target {
  enum class Kind { unicast, group, list, broadcast };
  Kind kind = Kind::unicast;
  std::vector<const Client*> recipients;  ///< one for unicast; unused for group and broadcast
  StreamId stream = 0;
};

/// A subject's own account of what it carried, in frames and recipients. Where nothing moves,
/// accepted + copies = delivered + dropped + queued.
struct Ledger {
  std::uint64_t accepted = 0;
  std::uint64_t copies = 0;
  std::uint64_t delivered = 0;
  std::uint64_t dropped = 0;
  std::uint64_t queued = 0;
};

/// How one subject is spoken to: the seam behind which each wire protocol is. Scenarios know clients, targets and
/// messages; a wire knows bytes. Virtual calls are per read buffer and per block, never per message.
class Wire {
 public:
  virtual ~Wire() = default;

  /// Sends what `client` has to say first. take() sets client.is_joined once the subject has admitted it.
  virtual void open(Client& client) = 0;
  /// Makes `client` the publisher of the one group of a run; take() sets client.is_in_group.
  virtual void provide(Client& client) = 0;
  /// Makes `client` a subscriber of that group. REQUIRES: the publisher is in the group.
  virtual void subscribe(Client& client) = 0;
  /// Appends one message of `from` with `payload` to `block`, in lane `lane` where the subject has lanes.
  virtual void append_message(const Client& from, const Target& target, std::uint8_t lane,
                              std::span<const std::byte> payload, MessageBlock& block) = 0;
  /// Hands the messages in `bytes` to client.inbox and answers what asks for an answer. Returns the bytes done; the
  /// rest is an incomplete message.
  [[nodiscard]] virtual std::size_t take(Client& client, std::span<const std::byte> bytes) = 0;
  /// Called once a second for every client.
  virtual void keep_alive(Client& client) = 0;

  /// Asks for the ledger; false: this subject keeps none. take() sets ledger().
  virtual bool ask_for_ledger(Client&) { return false; }
  [[nodiscard]] const std::optional<Ledger>& ledger() const { return ledger_; }

 protected:
  std::optional<Ledger> ledger_;
};

/// "null" or "gimnet"; nullptr for an unknown name.
[[nodiscard]] std::unique_ptr<Wire> make_wire(std::string_view name);

}  // namespace gimnet::perf
