#pragma once

#include <deque>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "tests/sim/hub_life.hpp"
#include "tests/sim/node.hpp"

namespace gimnet::sim {

/// The end of a world.
struct Report {
  std::uint64_t seed = 0;
  std::uint64_t hash = 0;
  std::uint64_t events = 0;  ///< in the trace
  std::uint64_t steps = 0;   ///< of the conductor, each of which was checked
  Census census;
  std::optional<Broken> broken;
  std::vector<std::string> last;  ///< the last events in words, if it broke
};

/// A hub and its nodes in simulated time: one seed gives the load, the timing, the faults and the
/// collisions. Thread safety: none; worlds share nothing.
class World {
 public:
  struct Options {
    std::uint64_t seed = 0;
    std::size_t nodes = 200;
    Faults without;      ///< faults that are left out, though the seed drew them
    bool print = false;  ///< every event, as it happens
    std::span<const std::uint8_t> choices{};  ///< of a fuzzer, taken before the seed's. Valid
                                              ///< until: the world ends
  };
  explicit World(const Options& options);
  World(const World&) = delete;
  World& operator=(const World&) = delete;

  /// Runs to its end, or to the first thing that is wrong.
  [[nodiscard]] Report run();

 private:
  void begin_life(Past past);
  /// The state that a hub kept before the world began.
  [[nodiscard]] Past make_disk();
  [[nodiscard]] std::string keep(const hub::HubState& state);
  void kill_hub();
  void plan_endings();
  /// Its process is gone.
  void stop_hub();
  void start_hub();
  /// An administrator or a signal has the hub drain.
  void want_drain();
  void begin_drain();
  /// Begins to drain, or ends, after events, as hub/control/conductor_loop.cpp does.
  void look_at_drain();
  void say_hello(const WirePointer& wire, const proto::Hello& hello, const hub::Identity& identity);
  void want_conductor(Time delay);
  /// One thing that the conductor does, out of those that wait for it.
  void conductor_turn();
  void admit();
  void look_whether_it_stood();
  void arm_clock();
  void live();
  void converge();
  void require_served(const SimNode& node) const;
  void require_agreed(const SimNode& node) const;
  void drain_for_good();

  const Options options_;
  Setting setting_;
  Network network_;
  std::vector<std::unique_ptr<SimNode>> nodes_;
  std::unique_ptr<HubLife> life_;
  std::vector<std::unique_ptr<HubLife>>
      dead_;            ///< earlier lives; something may still be under way to them
  hub::HubState disk_;  ///< what the hub kept last
  std::deque<HubLife::Newcomer> newcomers_;
  bool turn_due_ = false;
  bool clock_due_ = false;
  bool telling_due_ = false;
  std::optional<Time> clock_;  ///< when the conductor wants to look at it
  bool down_ = false;          ///< no hub is there
  bool last_life_ = false;     ///< it drains, and is not started again
  std::uint64_t lives_ = 0;
  std::uint64_t sessions_ = 0;
  std::uint64_t steps_ = 0;
};

}  // namespace gimnet::sim
