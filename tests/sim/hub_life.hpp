#pragma once

#include <array>
#include <functional>
#include <memory>

#include "hub/concurrent/quiescence.hpp"
#include "hub/control/conductor.hpp"
#include "tests/sim/checks.hpp"

namespace gimnet::sim {

/// One life of the hub, from its start to its end or to kill -9: the real conductor, between
/// simulated shards and the checkers. Thread safety: none.
class HubLife {
 public:
  static constexpr HubId kHub{7};
  /// The parts of the world that it needs.
  struct Around {
    Network& network;
    std::function<void()> conductor_wanted;
    std::function<bool(std::uint32_t node)> is_slow;
    hub::StateKeeper::Keep keep_state;
  };
  HubLife(Setting& setting, const Around& around, const hub::HubStart& start, Past past);

  /// A HELLO that arrived, and the wire that it came by.
  struct Newcomer {
    WirePointer wire;
    proto::Hello hello;
    hub::Identity identity;
  };
  /// The origin of a program: users come over a Unix socket, most others from one machine.
  [[nodiscard]] static hub::PeerInfo peer_of(const hub::Identity& identity, std::uint32_t node,
                                             std::uint64_t wire);
  /// Returns why it is refused. `number` is for the session, if it is a new one.
  [[nodiscard]] std::optional<proto::Goodbye> admit(const Newcomer& newcomer, std::uint64_t number);
  void take_event(std::size_t shard);
  void tick();
  /// The conductor looks at its clock so much later than it was to.
  void stood_still(milliseconds time);
  /// The hub is to end: nobody is let in any more, and everybody is told to go.
  void drain();
  [[nodiscard]] bool drains() const { return drains_; }
  /// A piece of what those who watch are to be told. True: there is more.
  bool tell_rest();
  [[nodiscard]] bool has_to_tell() const {
    return conductor_.watches().size() > 0 || conductor_.tells_later();
  }

  [[nodiscard]] hub::Conductor& conductor() { return conductor_; }
  [[nodiscard]] SimShards& shards() { return shards_; }
  [[nodiscard]] const Model& model() const { return model_; }
  /// The time that every wall clock shows.
  [[nodiscard]] static std::int64_t wall_ns(const Setting& setting) {
    return kWallNs + std::chrono::nanoseconds{setting.agenda.now()}.count();
  }

 private:
  static constexpr std::int64_t kWallNs = 1'800'000'000'000'000'000;
  void trace_sent();
  void after_step();
  /// The result of reading the configuration again.
  [[nodiscard]] hub::Reloading read_again();

  Setting& setting_;
  hub::NodeTable nodes_;
  hub::GroupTable groups_;
  hub::Quiescence quiescence_;
  std::array<hub::ShardCounters, 4> counters_;
  std::vector<const hub::ShardCounters*> readable_;
  Model model_;
  SimShards shards_;
  Checks checks_;
  hub::Limits limits_;
  hub::Conductor conductor_;
  bool kept_ = true;  ///< the hub could keep what it wanted to keep last
  bool drains_ = false;
};

}  // namespace gimnet::sim
