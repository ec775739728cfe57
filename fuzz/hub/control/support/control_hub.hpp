#pragma once

#include <chrono>
#include <cstdint>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "hub/control/conductor.hpp"
#include "tests/hub/control/support/fake_shards.hpp"

// The hub's own control library as fuzz targets drive it: shards that only write down what they are
// told, and no sockets, threads or clocks.

namespace gimnet::fuzz {

using std::chrono::milliseconds;

/// A session's place on its shard, by which commands name it.
struct Seat {
  std::uint8_t shard = 0;
  std::uint32_t slot = 0;
  std::uint32_t generation = 0;
  friend auto operator<=>(const Seat&, const Seat&) = default;
};

/// A connection as its shard knows it. What was said by it may still be under way when it has
/// ended.
struct Line {
  std::uint64_t session = 0;  ///< by the reference
  NodeId node;
  Seat seat;
  std::uint32_t attachment = 0;
  bool open = false;
  std::optional<proto::GoodbyeCode>
      told;  ///< the hub had it closed, and has not heard of its end yet
};

/// Who says HELLO.
struct Stranger {
  proto::Hello hello;
  std::string identity;
  bool may_administer = false;
  std::string place;
};

/// Ends in an abort where a command makes no sense: two answers, one to another connection, one
/// before the tables.
class ControlHub {
 public:
  static constexpr HubId kHub{7};
  static constexpr std::size_t kShards = 2;

  explicit ControlHub(const hub::Limits& first_limits);

  // Each of these is a step: `shards.sent` has the commands of the last one.
  [[nodiscard]] std::optional<proto::Goodbye> admit(const Stranger& stranger);
  /// The answer's payload, if there is one.
  [[nodiscard]] std::optional<proto::Payload> ask(const Line& line, proto::Kind kind,
                                                  std::span<const std::byte> payload, NodeId dst);
  void end(const Line& line, bool said_by_peer, proto::GoodbyeCode code);
  void pass(milliseconds time);
  [[nodiscard]] bool serve();
  void drain();
  void drained(std::size_t shard);

  /// All commands of one kind in the last step, with their shards.
  template <class Command>
  [[nodiscard]] std::vector<std::pair<std::uint8_t, const Command*>> all() const {
    std::vector<std::pair<std::uint8_t, const Command*>> found;
    for (const hub::FakeShards::Sent& each : shards.sent) {
      if (const auto* command = std::get_if<Command>(&each.command))
        found.emplace_back(each.shard.value(), command);
    }
    return found;
  }
  [[nodiscard]] milliseconds wall() const { return milliseconds{1'800'000'000'000} + now; }

  hub::Limits limits;
  hub::ReadAgain read_again;  ///< what RELOAD comes to
  hub::NodeTable nodes;
  hub::GroupTable groups;
  hub::Quiescence quiescence{kShards};
  hub::ShardCounters counters[kShards];
  const hub::ShardCounters* readable[kShards] = {&counters[0], &counters[1]};
  hub::FakeShards shards{kShards};
  milliseconds now{1'000};
  hub::Conductor conductor;

 private:
  static hub::HubFacts facts();
  /// The other shards take what each one handed over before it was told to fence, at once: a group
  /// that ends is gone.
  void pass_fences();
  void before_it_leaves(const hub::ShardCommand& command) const;
  /// Do the tables say what the hub's own state says?
  [[nodiscard]] bool groups_are_published() const;
};

[[nodiscard]] inline std::span<const std::byte> payload_of(const hub::SendControlCommand& command) {
  return std::span{command.frame}.subspan(proto::kHeaderSize);
}

}  // namespace gimnet::fuzz
