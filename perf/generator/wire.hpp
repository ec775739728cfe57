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

/// Words that only say that somebody is there.
struct KeepAlives {
  std::uint64_t said = 0;      ///< by the clients
  std::uint64_t answered = 0;  ///< of those, by the subject
  std::uint64_t asked = 0;     ///< by the subject of its own accord; each is answered
};

/// How one subject is spoken to: the seam behind which each wire protocol is. Scenarios know
/// clients, targets and messages; a wire knows bytes. Virtual calls are per read buffer and per
/// block, never per message.
class Wire {
 public:
  virtual ~Wire() = default;

  /// Sends what `client` has to say first. take() admits it (client.is_joined) once the subject
  /// has.
  virtual void open(Client& client) = 0;
  /// Sends what a publishing side has to say first, where the subject has such; take() admits it.
  virtual void open_side(Client& side) { side.is_joined = true; }
  /// Makes `client` the publisher of the one group of a run; take() sets client.is_in_group.
  virtual void provide(Client& client) = 0;
  /// Makes `client` a subscriber of that group. REQUIRES: the publisher is in the group.
  virtual void subscribe(Client& client) = 0;
  /// Appends one message of `from` with `payload` to `block`, in lane `lane` where the subject has
  /// lanes.
  virtual void append_message(const Client& from, const Target& target, std::uint8_t lane,
                              std::span<const std::byte> payload, MessageBlock& block) = 0;
  /// Hands the messages in `bytes` to client.inbox and answers what asks for an answer. Returns the
  /// bytes done; the rest is an incomplete message.
  [[nodiscard]] virtual std::size_t take(Client& client, std::span<const std::byte> bytes) = 0;
  /// Called once a second for every client.
  virtual void keep_alive(Client& client) = 0;

  /// Clients that were admitted so far, publishing sides not among them.
  [[nodiscard]] std::size_t joined_count() const { return joined_count_; }

  /// All so far; none where clients of this protocol need not say anything.
  [[nodiscard]] const KeepAlives& keep_alives() const { return keep_alives_; }

  /// Asks for the ledger; false: this subject keeps none. take() sets ledger().
  virtual bool ask_for_ledger(Client&) { return false; }
  [[nodiscard]] const std::optional<Ledger>& ledger() const { return ledger_; }

 protected:
  /// Marks `client` as joined; once.
  void admit(Client& client) {
    if (client.is_joined) return;
    client.is_joined = true;
    if (!client.is_side) ++joined_count_;
  }

  std::optional<Ledger> ledger_;
  KeepAlives keep_alives_;

 private:
  std::size_t joined_count_ = 0;
};

/// "null", "gimnet", "nats", "mqtt", "resp" or "zmtp"; nullptr for an unknown name.
[[nodiscard]] std::unique_ptr<Wire> make_wire(std::string_view name);

}  // namespace gimnet::perf
