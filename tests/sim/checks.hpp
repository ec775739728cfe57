#pragma once

#include <compare>
#include <map>
#include <set>
#include <string>
#include <vector>

#include "hub/control/conductor.hpp"
#include "tests/sim/model.hpp"

namespace gimnet::sim {

/// Compares a hub with the reference model after each of the conductor's steps. Thread safety:
/// none. Errors: Broken.
class Checks {
 public:
  struct Subject {
    const hub::NodeTable& nodes;
    const hub::GroupTable& groups;
    const SimShards& shards;
    HubId hub;
    const hub::Limits& limits;
  };
  Checks(const Subject& subject, Model& model) : subject_(subject), model_(model) {}
  /// The conductor, which sends commands while it is being made.
  void watch(const hub::Conductor& conductor) { conductor_ = &conductor; }

  void before_it_leaves(ShardIndex shard, const hub::ShardCommand& command);
  void after_step(milliseconds now);
  /// The conductor was told to drain: so is each shard, once.
  void after_drain() const;

 private:
  void events();
  [[nodiscard]] std::vector<DueEvent> told_events() const;
  /// Can that wait to be told, or the node have been told otherwise by now?
  [[nodiscard]] bool may_wait(const DueEvent& event) const;
  void told_again() const;
  [[nodiscard]] std::string told_moved(const proto::Payload& payload, std::uint32_t to) const;
  [[nodiscard]] std::string told_subscribers(const proto::Payload& payload) const;
  void sessions() const;
  void names() const;
  void node_table() const;
  void group_table();
  void commands();
  void paces();
  void pace_of(std::uint32_t group, const Model::Topic& topic) const;
  void deadline(milliseconds now) const;
  /// "" or what a table says that the hub's own state does not.
  [[nodiscard]] std::string stale() const;
  [[nodiscard]] bool is_right(const hub::GroupMembers* members, const Model::Topic* topic) const;

  const Subject subject_;
  Model& model_;
  const hub::Conductor* conductor_ = nullptr;
  std::string out_of_order_;
  std::map<std::uint32_t, hub::Place> places_;  ///< of the sessions that shards were given
  std::set<std::uint32_t> touched_;             ///< groups that this step may have changed
  std::set<std::uint32_t> untold_;              ///< and whose paces were not looked at yet
  /// Groups as they were published when they were right. What is published is never changed.
  std::map<std::uint32_t, const hub::GroupMembers*> seen_;
  std::uint64_t steps_ = 0;
  std::vector<DueEvent> owed_;  ///< SERVICE_MOVED in pieces that have not come yet; in order
  bool tells_later_ = false;    ///< before this step
  /// A session, as commands name it.
  struct Seat {
    std::uint8_t shard = 0;
    std::uint32_t slot = 0;
    std::uint32_t generation = 0;
    friend auto operator<=>(const Seat&, const Seat&) = default;
  };
  struct Pace {
    hub::PaceTerms terms;
    bool retained = false;
    friend bool operator==(const Pace&, const Pace&) = default;
  };
  std::map<std::uint32_t, std::map<Seat, Pace>> paces_;  ///< by group, as the shards were told
};

}  // namespace gimnet::sim
