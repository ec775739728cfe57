#pragma once

#include <array>
#include <cstdint>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "tests/sim/agenda.hpp"
#include "tests/sim/hubs/line.hpp"
#include "tests/sim/hubs/sim_node.hpp"

namespace gimnet::sim::hubs {

struct Scene;

/// Of one link, with its jitter.
inline constexpr std::uint64_t kSlowestMs = 60;

/// A machine that runs a hub, and what outlives the process.
struct Machine {
  HubPlan plan;
  hub::HubState disk;
  std::unique_ptr<SimHub> hub;  ///< null: it does not run
  std::uint64_t life = 0;       ///< counts its processes
  bool redrawn = false;         ///< its next process begins anew under another hub id
  bool stopped = false;         ///< its process gets no time
  bool dark = false;            ///< it has no power: nobody is told
};

/// A way between two hubs.
struct Wire {
  WirePlan plan;
  std::array<bool, 2> cut{};  ///< nothing passes that way, from the dialler and to it
  bool wanted = true;
  std::uint64_t frames = 0;  ///< that were written to it, both ways
  /// The place at either end, in that life of its hub, and the line on which its counts began.
  struct Counted {
    std::uint64_t life = 0;
    std::uint32_t generation = 0;
    std::uint64_t line = 0;
  };
  std::array<Counted, 2> counted{};
};

/// Whole hubs, nodes and links that one seed gives. First faults come, then none. When 6 s have
/// passed everything must be settled; 12 s later where a link is damped or a hub waits because its
/// state folder may be a copy. Then all nodes send to each other. Thread safety: none.
class World {
 public:
  struct Options {
    std::uint64_t seed = 1;
    Size size;
    bool print = false;            ///< what happens, in words
    const Scene* scene = nullptr;  ///< takes the place of what the seed draws. Null: none
    bool is_long = false;          ///< the scene may take longer
  };
  explicit World(const Options& options);
  /// Nothing: all is as it should be.
  [[nodiscard]] std::optional<Broken> run();
  [[nodiscard]] std::string words() const;
  [[nodiscard]] const Census& census() const { return census_; }

 private:
  friend class Settled;
  friend class Stage;

  // Time
  void run_until(milliseconds end);
  void step();
  void check_bounds();
  [[nodiscard]] std::uint64_t most_waiting() const;

  // Hubs
  [[nodiscard]] hub::HubState new_disk(std::uint64_t unique);
  void start(std::size_t machine);
  void stop(std::size_t machine);
  [[nodiscard]] SimHub::Setup setup_of(std::size_t machine);
  [[nodiscard]] SimHub* hub(std::size_t machine) {
    const Machine& each = machines_[machine];
    return each.stopped || each.dark ? nullptr : each.hub.get();
  }

  // Links (connections.cpp)
  [[nodiscard]] static hub::DialledLink link_of(std::size_t wire);
  void dial(std::size_t machine, hub::LinkNumber number, const hub::DialledLink& to,
            const proto::Hello& hello);
  void attempt(const std::shared_ptr<Line>& line, std::size_t tries);
  void reach_acceptor(const std::shared_ptr<Line>& line);
  void fail(Line& line, net::NetError error);
  void carry(Line& line);
  void come_to_dialler(Line& line, std::span<const std::byte> bytes);
  [[nodiscard]] bool is_over(const Line& line) const;
  void note_dialled(const Line& line);
  void note_counts(const Line& line, std::size_t end);
  /// Null: that end knows no such link, or never had it.
  [[nodiscard]] const hub::HubLink* find_link(std::size_t wire, std::size_t end) const;

  // Faults (faults.cpp)
  void fault();
  void fault_of_a_wire(std::uint64_t kind);
  void change_a_wire(std::uint64_t kind);
  void fault_of_a_machine(std::uint64_t kind);
  void cut_for(std::size_t wire, bool there, bool back, std::uint64_t ms);
  void reset(std::size_t wire);
  /// ends: a bit for each that is told.
  void reset(std::size_t wire, std::uint64_t ends);
  void partition();
  void heal();

  void note(const std::string& words) const;
  void note_plan() const;
  [[nodiscard]] milliseconds now() const { return now_; }
  /// The agenda's own clock stands at what happened last.
  void after_ms(std::uint64_t ms, Agenda::Action action) {
    agenda_.at(now_ + milliseconds(ms), std::move(action));
  }

  const Options options_;
  Random random_;
  const Plan plan_;
  Agenda agenda_;
  milliseconds now_{0};
  Census census_;
  Book book_;
  std::vector<Machine> machines_;
  std::vector<Wire> wires_;
  std::vector<SimNode> nodes_;
  std::vector<SimNode> operators_;  ///< one at each hub
  std::vector<std::shared_ptr<Line>> lines_;
  std::uint64_t lines_begun_ = 0;
  std::size_t redraws_ = 0;                ///< hubs that began anew under another id
  std::optional<milliseconds> copied_at_;  ///< when a hub was last taken for a copy
  bool faults_ = true;                     ///< they may come, and nodes speak by themselves
};

/// Looks at a world that was left alone: settled.cpp, moves.cpp, groups.cpp, acceptors.cpp,
/// arrivals.cpp.
class Settled {
 public:
  explicit Settled(World& world);
  /// Does something wait longer than the time to settle, for a reason that is known?
  [[nodiscard]] static bool waits(World& world);
  void check();

 private:
  friend class Stage;
  struct Pair {
    const SimNode* from;
    const SimNode* to;
    std::uint64_t number;
  };
  /// A service with last message.
  struct Given {
    SimNode* node;
    GroupId group;
    std::uint64_t last = 0;  ///< 0: none
  };
  [[nodiscard]] bool has_edge(std::size_t one, std::size_t other) const;
  void check_wires() const;
  void check_tables() const;
  void check_ways(std::size_t from) const;
  [[nodiscard]] std::optional<int> follow(std::size_t from, std::size_t to) const;
  void find_distances();
  void check_moves();
  void check_groups();
  /// May that operator subscribe to it?
  [[nodiscard]] bool is_near(const SimNode& person, const Given& each) const;
  void check_counts(const std::vector<Given>& all) const;
  void check_missed(const std::vector<Given>& all);
  void check_acceptors();
  void compare_acceptors(const char* when);
  void ask_names();
  void check_names();
  void send_to_all();
  void check_arrivals() const;
  [[nodiscard]] std::string drops() const;
  void check_rest();
  void check_ledgers() const;

  World& world_;
  std::vector<std::vector<int>> distance_;  ///< links between two hubs; -1: not connected
  std::vector<Pair> pairs_;
  std::vector<std::string> names_;
};

}  // namespace gimnet::sim::hubs
