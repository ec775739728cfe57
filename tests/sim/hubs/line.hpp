#pragma once

#include <array>
#include <chrono>
#include <cstddef>
#include <cstdint>
#include <deque>
#include <functional>
#include <memory>
#include <optional>
#include <vector>

#include "hub/network/state/network_map.hpp"
#include "net/dial_handshake.hpp"
#include "proto/frame/frame_header.hpp"
#include "tests/sim/hubs/plan.hpp"
#include "tests/support/memory_stream.hpp"

namespace gimnet::sim::hubs {

/// One direction of a connection: bytes come late and in order, as many at a time as the way has
/// room for. Thread safety: none.
class Flow {
 public:
  using Tap = std::function<void(const proto::FrameHeader&, std::span<const std::byte> payload)>;

  /// `opens`: the 8 bytes of the opening come first.
  Flow(const WirePlan& way, hub::MemoryPeer from, bool opens);
  /// Takes what was written. Each whole frame is told to `tap` once.
  void take(Random& random, std::chrono::milliseconds now, const Tap& tap);
  /// The next piece that has arrived; an empty one is the end. Nothing: none.
  [[nodiscard]] std::optional<std::vector<std::byte>> arrive(std::chrono::milliseconds now);
  /// Nothing comes any more.
  [[nodiscard]] bool ended() const { return ended_; }
  /// Sets a reserved flag in the next UNICAST.
  void spoil_next() { spoils_ = true; }

 private:
  struct Piece {
    std::chrono::milliseconds at;
    std::vector<std::byte> bytes;
  };
  void look(const Tap& tap);
  void spoil(std::span<std::byte> frame);

  const WirePlan& way_;
  hub::MemoryPeer from_;
  std::deque<Piece> under_way_;
  std::size_t bytes_ = 0;  ///< under way
  std::uint64_t allowed_ = 0;
  std::chrono::milliseconds last_{0};
  std::vector<std::byte> frames_;  ///< taken, not told to the tap
  std::size_t skip_;
  bool spoils_ = false;
  bool says_end_ = false;
  bool ended_ = false;
};

/// A connection between two hubs over a wire, from the first packet of its dialler on. Thread
/// safety: none.
struct Line {
  Line(std::size_t index, const WirePlan& way);

  const std::size_t wire;
  std::uint64_t dialler_life = 0;
  std::uint64_t number = 0;  ///< of all lines of the world
  hub::LinkNumber link;      ///< of the dialler
  proto::Hello hello;
  std::unique_ptr<net::Stream> stream;   ///< of the dialler, until it has been welcomed
  std::unique_ptr<net::Stream> other;    ///< of the acceptor, until it was asked
  std::array<hub::MemoryPeer, 2> peers;  ///< far ends of the dialler's and of the acceptor's stream
  std::array<Flow, 2> flows;             ///< from the dialler, and to it
  net::DialHandshake handshake;
  bool accepted = false;
  bool failed = false;  ///< the dialler was told that nothing came of it
  bool dead = false;    ///< nothing passes any more: a machine at one end lost its power

 private:
  using Pipe = std::pair<std::unique_ptr<net::Stream>, hub::MemoryPeer>;
  Line(std::size_t index, const WirePlan& way, Pipe dialler, Pipe acceptor);
};

}  // namespace gimnet::sim::hubs
