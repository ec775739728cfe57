#pragma once

#include <cstddef>
#include <cstdint>
#include <deque>
#include <functional>
#include <memory>
#include <vector>

#include "hub/control/state/identity.hpp"
#include "net/stream.hpp"
#include "tests/sim/setting.hpp"

namespace gimnet::sim {

/// The identity that may administer the hub, as the system tells it.
inline constexpr hub::Identity kAdministrator = hub::Identity::of_user(0);

using Bytes = std::vector<std::byte>;

/// A connection, with both its ends. Frames arrive in the order in which they were sent, after some
/// time.
struct Wire {
  std::uint64_t number = 0;
  std::uint32_t node = 0;    ///< who dialled
  bool node_open = true;     ///< the node's end
  bool hub_open = true;      ///< the hub's end
  bool end_arrived = false;  ///< the hub can see that the node closed
  bool mute = false;         ///< nothing is heard of the node, keep-alive neither
  std::uint64_t mutes = 0;   ///< which silence it is
  std::deque<Bytes> at_hub;  ///< arrived, not read
  Time next_at_hub{};
  Time next_at_node{};
  std::uint64_t session =
      0;  ///< that it was admitted for, as the reference model says; 0: not admitted
  // The shard's part
  bool attached = false;
  std::size_t shard = 0;
  std::uint32_t slot = 0;
};
using WirePointer = std::shared_ptr<Wire>;

/// The end of a wire that the conductor or a shard holds.
class WireStream final : public net::Stream {
 public:
  explicit WireStream(WirePointer wire) : wire_(std::move(wire)) {}
  net::IoResult receive(std::span<std::byte>) override { return {}; }
  net::IoResult send(std::span<const iovec>) override { return {}; }
  void shut_down() override {}
  [[nodiscard]] std::uint64_t unsent_bytes() const override { return 0; }
  void limit_unsent(std::uint32_t) override {}
  void limit_unacknowledged(std::uint32_t) override {}
  [[nodiscard]] int descriptor() const override { return -1; }
  [[nodiscard]] const WirePointer& wire() const { return wire_; }

 private:
  WirePointer wire_;
};

/// Brings frames from one end of a wire to the other. Thread safety: none.
class Network {
 public:
  /// Whom it wakes.
  struct Ends {
    std::function<void(Wire&)> hub_has_something;
    std::function<void(const WirePointer&, const Bytes&)> node_hears;
    std::function<void(const WirePointer&)> node_sees_the_end;
  };
  explicit Network(Setting& setting) : setting_(setting) {}
  void connect(Ends ends) { ends_ = std::move(ends); }

  [[nodiscard]] WirePointer dial(std::uint32_t node);
  /// When something sent now arrives.
  [[nodiscard]] Time arrival(Time& next);
  void to_hub(const WirePointer& wire, Bytes frame);
  void to_node(const WirePointer& wire, Bytes frame);
  /// The node's end closes; the hub learns of it after what was sent, or (`unseen`) not at all.
  void close_by_node(const WirePointer& wire, bool unseen);
  void close_by_hub(const WirePointer& wire);

 private:
  /// The time that a frame is under way, faults of the network included.
  [[nodiscard]] Time time_under_way();
  Setting& setting_;
  Ends ends_;
  std::uint64_t last_ = 0;
};

}  // namespace gimnet::sim
