#pragma once

#include <chrono>
#include <cstdint>
#include <functional>
#include <memory>
#include <optional>
#include <unordered_map>
#include <utility>
#include <vector>

#include "hub/control/conductor.hpp"
#include "hub/control/event_turns.hpp"
#include "hub/shard/io_shard.hpp"
#include "tests/support/memory_stream.hpp"

namespace gimnet::sim::hubs {

using std::chrono::milliseconds;

/// A hub of the product without threads and sockets: its conductor and one shard take turns in
/// simulated time, over streams in memory. Thread safety: none.
class SimHub {
 public:
  struct Setup {
    hub::HubFacts facts;
    hub::Limits limits;
    hub::HubStart start;
    hub::LinksOptions links;
  };
  /// The world, as far as the hub asks for it.
  struct Around {
    hub::Links::Dial dial;
    std::function<std::int64_t()> wall_now_ns;
    std::function<std::uint64_t()> random;
    hub::StateKeeper::Keep keep;
  };
  /// A node that was let in.
  struct Admitted {
    NodeId node;
    bool new_session = true;
  };

  SimHub(Setup setup, Around around);
  ~SimHub();
  SimHub(const SimHub&) = delete;
  SimHub& operator=(const SimHub&) = delete;

  /// All that is to be done at this time. Computing takes no time.
  void step(milliseconds now);
  /// `peer`: the far end of the stranger's stream.
  [[nodiscard]] std::optional<proto::Goodbye> admit(hub::Stranger stranger, hub::MemoryPeer peer,
                                                    const proto::Hello& hello, milliseconds now);
  /// The node that the last admit() let in; without an id: it waits for another hub.
  [[nodiscard]] const Admitted& admitted() const { return door_.admitted; }
  void on_dialled(hub::LinkNumber link, std::unique_ptr<net::Stream> stream, hub::MemoryPeer peer,
                  const proto::Welcome& welcome, milliseconds now);
  void on_not_dialled(hub::LinkNumber link, net::NetError error, milliseconds now);
  void drain() {
    drains_ = true;
    looked_ = false;
    conductor_.drain();
  }
  /// It ends within its time to drain, also where a link does not take what waits.
  [[nodiscard]] bool drains() const { return drains_; }
  /// The id with which it is to begin anew once it has drained.
  [[nodiscard]] std::optional<HubId> redrawn() const { return conductor_.redrawn(); }
  [[nodiscard]] bool drained() const { return conductor_.drained(); }

  [[nodiscard]] const hub::HubFacts& facts() const { return setup_.facts; }
  [[nodiscard]] const hub::Links& links() const { return *conductor_.links(); }
  [[nodiscard]] const hub::Topics& topics() const { return conductor_.membership().topics(); }
  [[nodiscard]] const hub::RouteTable& routes() const { return routes_; }
  [[nodiscard]] const hub::GroupTable& groups() const { return groups_; }
  [[nodiscard]] hub::ShardState& shard() { return shard_.state(); }
  [[nodiscard]] const hub::ShardCounters& counters() const { return counters_; }
  [[nodiscard]] hub::SessionCounts counts(const hub::Place& place) const {
    return sessions_.counts(place.slot, place.generation);
  }

 private:
  /// The conductor's door to the shard.
  struct Door final : hub::ShardProxy {
    explicit Door(hub::IoShard& to) : shard(to) {}
    void send(ShardIndex index, hub::ShardCommand command) override;
    [[nodiscard]] std::size_t shards() const override { return 1; }
    hub::IoShard& shard;
    Admitted admitted;
    bool sent = false;
  };
  [[nodiscard]] hub::HubShared shared();
  [[nodiscard]] hub::Conductor::Wiring wiring(Around around);
  void add_peer(const net::Stream* stream, hub::MemoryPeer peer);
  bool turn(milliseconds now);
  bool take_events(milliseconds now);
  void find_ready();

  Setup setup_;
  const std::function<std::int64_t()> wall_now_ns_;
  hub::NodeTable nodes_;
  hub::GroupTable groups_;
  hub::RouteTable routes_;
  hub::Quiescence quiescence_{1};
  hub::Budget budget_;
  hub::Budget link_budget_;
  hub::Budget retained_budget_;
  hub::ControlInbox inbox_{1};
  hub::Waker waker_;
  hub::Mailbox mailbox_;
  hub::ShardCounters counters_;
  hub::SessionGauges sessions_;
  const hub::ShardCounters* readable_[1] = {&counters_};
  const hub::SessionGauges* readable_sessions_[1] = {&sessions_};
  hub::RefusalCounters refusals_;
  const hub::HubShared shared_;
  hub::IoShard shard_;
  Door door_;
  hub::Conductor conductor_;
  hub::EventTurns turns_;
  std::unordered_map<const net::Stream*, hub::MemoryPeer> peers_;
  std::vector<hub::Ready> ready_;
  std::optional<milliseconds> stepped_;  ///< the last time
  milliseconds turn_at_{0};
  bool more_to_tell_ = false;
  std::optional<milliseconds> due_;  ///< of the conductor, unless something came since
  bool looked_ = false;              ///< due_ is known
  bool drains_ = false;
};

}  // namespace gimnet::sim::hubs
