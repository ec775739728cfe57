#pragma once

#include <chrono>
#include <cstddef>
#include <cstdint>
#include <memory>
#include <optional>
#include <utility>
#include <vector>

#include "hub/network/state/name_exchange.hpp"
#include "hub/network/state/network_state.hpp"
#include "tests/sim/random.hpp"

namespace gimnet::sim::scale {

using std::chrono::milliseconds;

/// Two hubs that are linked.
using Pair = std::pair<std::size_t, std::size_t>;

/// A network to be measured. All of its hubs start at once.
struct Shape {
  const char* name = "";
  std::size_t hubs = 0;
  std::size_t names = 0;  ///< of each hub; 0: routes only
  std::vector<Pair> links;
  /// Of the first so many hubs all is simulated. Each other one has one link. It says its record,
  /// and what comes to it is counted and thrown away. 0: all of all.
  std::size_t whole = 0;
};

struct Figures {
  milliseconds converged{0};       ///< after the start
  milliseconds rerouted{0};        ///< after a link ended
  std::uint64_t start_bytes = 0;   ///< control frames of all hubs until it has converged
  std::uint64_t change_bytes = 0;  ///< because a link ended
  std::uint64_t idle_bytes_per_s = 0;
  std::uint64_t memory_bytes = 0;  ///< of all that is simulated
  std::uint64_t messages = 0;
  std::size_t wholes = 0;  ///< hubs of which all is simulated
};

/// The routes and names of many hubs (hub/network/state) over links that take 1 ms. Links come up
/// within 50 ms of the start. Computing takes no time. Each hub has copies of its own of all
/// records and names. Thread safety: none. Errors: a network that does not converge within 120 s
/// ends the program.
class ScaleNet {
 public:
  ScaleNet(const Shape& shape, std::uint64_t seed);
  [[nodiscard]] Figures measure();

 private:
  using Bytes = std::shared_ptr<const proto::Payload>;
  struct Hub {
    std::unique_ptr<hub::NetworkState> state;
    std::unique_ptr<hub::NameExchange> names;  ///< null: routes only
    bool whole = true;
    std::uint64_t maps = 0;
    std::optional<milliseconds> due;
    std::optional<std::pair<milliseconds, std::uint64_t>> digest;  ///< of that time
  };
  struct End {
    std::size_t hub = 0;
    hub::LinkNumber number;  ///< at that hub
    bool begun = false;
  };
  struct Link {
    End ends[2];
    bool up = false;
  };
  struct Message {
    std::size_t link;
    int to;
    Bytes bytes;  ///< null: a keep-alive
    std::uint64_t digest = 0;
  };

  void add_hub(std::size_t index);
  void put_names(std::size_t index);
  void open(std::size_t link);
  void begin(std::size_t link, int end);
  void end(std::size_t link);
  void step();
  void arrive(const Message& message);
  void keep_alive(std::size_t link);
  [[nodiscard]] std::uint64_t digest_of(Hub& hub);
  void turn(std::size_t index);
  void send(std::size_t hub, std::span<const hub::Sending> sendings);
  void settle();
  void require_equal() const;

  const Shape shape_;
  Random random_;
  std::vector<Hub> hubs_;
  std::vector<Link> links_;
  std::vector<std::vector<std::pair<std::size_t, int>>> ends_of_;  ///< by hub and link number
  std::vector<std::pair<milliseconds, std::size_t>> opens_;        ///< descending by time
  std::vector<Message> arriving_;
  std::vector<Message> sent_;
  milliseconds now_{1'000};
  milliseconds changed_{0};  ///< the last time that a map or a name changed
  std::uint64_t bytes_ = 0;
  std::uint64_t messages_ = 0;
};

/// A ring, and for each hub one more link to any other.
[[nodiscard]] std::vector<Pair> mesh(std::size_t hubs, std::uint64_t seed);
[[nodiscard]] std::vector<Pair> star(std::size_t hubs);

}  // namespace gimnet::sim::scale
