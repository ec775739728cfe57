#pragma once

#include <array>
#include <chrono>
#include <cstdint>
#include <map>
#include <memory>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "hub/network/state/name_exchange.hpp"
#include "hub/network/state/network_state.hpp"
#include "tests/sim/agenda.hpp"
#include "tests/sim/random.hpp"
#include "tests/sim/routes/census.hpp"
#include "tests/sim/routes/plan.hpp"

namespace gimnet::sim::routes {

/// In milliseconds: how long a hub waits that met a copy of itself.
inline constexpr std::uint64_t kRetryOfCopies = 10'000;

/// The checkers. Each checker has a planted bug that it must find.
enum class Checker : std::uint8_t {
  never_back,     ///< a record is not sent back over the link that it came from
  joined,         ///< every link stands, or was refused for a reason that is true
  one_id,         ///< of connected hubs no two have one hub id, and the first one keeps it
  equal_tables,   ///< connected hubs know the same hubs and have the same digest
  shortest,       ///< every way costs what the cheapest one costs
  arrives,        ///< frames that follow the next hops arrive, without a loop, within 31 hops
  quiet,          ///< no records and names are sent any more
  equal_names,    ///< connected hubs know the same names
  one_owner,      ///< of connected hubs one has a name
  names_bounded,  ///< names take a bounded room, and few are under way
  own_word,       ///< what a neighbour says of itself comes from it alone, and is known to all
};
inline constexpr std::array<std::string_view, 11> kCheckerNames = {
    "never_back", "joined",      "one_id",    "equal_tables",  "shortest", "arrives",
    "quiet",      "equal_names", "one_owner", "names_bounded", "own_word"};

struct Failure {
  Checker checker;
  std::string what;
};

using std::chrono::milliseconds;

/// A node that has a name.
struct Node {
  std::uint32_t index = 0;
  proto::route::NameState state = proto::route::NameState::held;
};

/// A process, and what outlives it.
struct Hub {
  HubPlan plan;
  std::unique_ptr<hub::NetworkState> state;  ///< null: it does not run
  std::unique_ptr<hub::NameExchange> names;
  std::map<std::string, Node> nodes;  ///< by name
  std::uint64_t life = 0;             ///< another one after a start, or when it left the network
  milliseconds away_until{0};         ///< it left the network because of a verdict
  std::optional<milliseconds> wake;   ///< when it has something to do
};

/// One end of a link.
struct End {
  std::size_t hub = 0;
  bool open = false;
  std::uint64_t connection = 0;  ///< the present one of this end
  milliseconds last_arrival{0};  ///< messages towards this end come in order
  bool lose_next = false;        ///< a record towards this end gets lost unseen
  bool damped = false;           ///< it says the highest cost
  proto::HubKey peer;            ///< while it is open
  int names = 0;                 ///< NAMES under way towards this end
  std::uint64_t names_connection = 0;
};
/// A link between two hubs: end 0 dials.
struct Wire {
  WirePlan plan;
  std::array<End, 2> ends;
  bool wanted = true;
  bool cut = false;        ///< nothing passes, and nobody is told
  std::uint64_t dead = 0;  ///< connections up to this one carry nothing any more
  milliseconds dial_not_before{0};
  struct Refusal {
    hub::LinkAdmission admission;
    hub::HubIdentity refused;
    std::size_t refusing = 0;
    milliseconds at{0};
  };
  std::optional<Refusal> refusal;  ///< of the last attempt
};

/// Hubs and links that one seed gives. The hubs are those of hub/network/state. Links come up, are
/// refused and break in a few lines of this simulation; all messages of one direction come in
/// order. First faults come, then none: 6 s later (26 s where a copied state folder makes hubs wait
/// 10 s) everything must be settled. Thread safety: none.
class World {
 public:
  explicit World(std::uint64_t seed);
  /// Nothing: all is as it should be.
  [[nodiscard]] std::optional<Failure> run();
  [[nodiscard]] std::string words() const;
  [[nodiscard]] const Census& census() const { return census_; }

 private:
  friend class Settled;
  using Payload = std::shared_ptr<const proto::Payload>;
  /// Of a keep-alive only the digest counts here.
  struct Message {
    Payload bytes;  ///< null: a keep-alive
    std::uint64_t digest = 0;
  };

  // Hubs
  void start(std::size_t hub);
  void stop(std::size_t hub);
  void leave(std::size_t hub, bool draw, milliseconds pause);
  void turn(std::size_t hub);
  void send(std::size_t hub, const hub::Sending& sending);
  [[nodiscard]] bool takes_part(std::size_t hub) const;

  // Links (links.cpp)
  void dial_again(std::size_t wire);
  void dial(std::size_t wire);
  void welcome(std::size_t wire, std::uint64_t dialler_life, std::uint64_t acceptor_life);
  [[nodiscard]] hub::LinkAdmissionAnswer admit(std::size_t at, std::size_t newcomer);
  void open(std::size_t wire, int end, std::uint64_t connection);
  void close(std::size_t wire, int end, bool tell);
  void refuse(std::size_t wire, int refusing, const hub::LinkAdmissionAnswer& answer);
  void pass(std::size_t wire, int to, Message message);
  void arrive(std::size_t wire, int to, std::uint64_t connection, std::uint64_t life,
              const Message& message);
  void take_record(std::size_t wire, std::size_t hub, const Payload& bytes);
  [[nodiscard]] bool hears_itself(std::size_t hub, const proto::HubKey& neighbour) const;
  void keep_alive(std::size_t wire);
  void cut(std::size_t wire);
  void notice_silence(std::size_t wire);

  // Names (names.cpp)
  void start_names(std::size_t hub);
  void put_names(std::size_t hub);
  void change_a_name();
  void turn_names(std::size_t hub);
  void count_names(End& target, std::uint64_t connection, const Message& message, int more);

  // Faults (faults.cpp)
  void fault();
  void fault_of_a_wire(std::uint64_t kind);
  void fault_of_a_hub(std::uint64_t kind);
  void forge(std::size_t wire, int liar);
  void damp(End& end, std::size_t wire, bool damped);
  void partition();
  void heal();

  [[nodiscard]] milliseconds now() const { return agenda_.now_ms(); }
  void after_ms(std::uint64_t ms, Agenda::Action action) {
    agenda_.after(milliseconds(ms), std::move(action));
  }
  void fail(Checker checker, std::string what) {
    if (!failure_) failure_ = Failure{checker, std::move(what)};
  }
  [[nodiscard]] hub::HubIdentity identity(std::size_t hub) const {
    return hubs_[hub].state->self();
  }

  Random random_;
  const Plan plan_;
  Agenda agenda_;
  std::vector<Hub> hubs_;
  std::vector<Wire> wires_;
  std::uint64_t last_number_ = 0;          ///< of instances and connections
  std::optional<milliseconds> last_copy_;  ///< when a hub was last taken for a copy
  std::uint64_t records_sent_ = 0;
  Payload arriving_;  ///< the record that was taken in this step, and where from
  std::size_t arriving_wire_ = 0;
  std::size_t arriving_hub_ = 0;
  Census census_;
  std::optional<Failure> failure_;
};

/// Looks at a world that was left alone: settled.cpp.
class Settled {
 public:
  explicit Settled(World& world);
  void check();

 private:
  [[nodiscard]] bool stands(const Wire& wire) const;
  [[nodiscard]] bool is_explained(const Wire& wire) const;
  void check_wires();
  void check_ids();
  void check_tables(std::size_t hub);
  void check_words(std::size_t hub);
  void check_ways(std::size_t hub);
  /// names.cpp
  void check_names(std::size_t hub);
  /// The hub where a frame ends up, and after how many hops. Nothing: nowhere.
  [[nodiscard]] std::optional<std::pair<std::size_t, int>> follow(std::size_t from, HubId to) const;
  void find_shortest();

  World& world_;
  std::vector<std::size_t> component_;  ///< of each hub: the lowest hub that it is connected to
  std::vector<std::vector<std::uint64_t>> shortest_;
};

}  // namespace gimnet::sim::routes
