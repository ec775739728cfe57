#pragma once

#include <array>
#include <bitset>
#include <chrono>
#include <cstdint>
#include <string_view>

#include "hub/limits.hpp"
#include "tests/sim/agenda.hpp"
#include "tests/sim/random.hpp"

namespace gimnet::sim {

/// The world of a seed: sizes, limits, and the rate of each fault in thousandths of a node's acts.
/// 0 switches a kind of fault off. Each seed switches some off (swarm testing, Groce et al., ISSTA
/// 2012).
struct Plan {
  std::size_t nodes = 0;
  std::size_t shards = 1;
  hub::Limits limits;
  std::uint32_t names = 1;       ///< that nodes wish for; fewer than nodes, so that they collide
  std::uint64_t nameless = 0;    ///< thousandths of the nodes
  std::uint64_t waits_away = 0;  ///< thousandths of the nodes: they ask for resume
  std::uint32_t acts_ms = 0;     ///< mean time between two acts of a node
  Time faults_until{};
  Time end{};
  Time latency_most{};  ///< of a connection, one way
  // Thousandths of acts
  std::uint64_t crash = 0;
  std::uint64_t vanish = 0;
  std::uint64_t hang = 0;
  std::uint64_t goodbye = 0;
  std::uint64_t twin = 0;
  std::uint64_t misconduct = 0;
  std::uint64_t administers = 0;  ///< of an administrator's acts
  std::uint64_t flood = 0;
  // Thousandths of other occasions
  std::uint64_t bad_token = 0;          ///< of HELLOs
  std::uint64_t lost_token = 0;         ///< of crashes
  std::uint64_t rename = 0;             ///< of HELLOs
  std::uint64_t slow_reader = 0;        ///< of nodes
  std::uint64_t bad_configuration = 0;  ///< of reloads
  std::uint64_t latest = 0;             ///< of services
  std::uint64_t sync = 0;               ///< of services
  std::uint64_t retain = 0;             ///< of services
  std::uint64_t terms = 0;              ///< of subscriptions: they want less than all
  std::uint64_t late_credit = 0;        ///< of messages of sync services
  std::uint64_t queue_messages = 0;     ///< of services, that wait for a node at most
  std::uint64_t stall = 0;              ///< of frames: they were lost and sent again
  std::uint64_t clog = 0;               ///< of frames: nothing passes the connection for a while
  std::uint64_t shard_pause = 0;        ///< of turns
  std::uint64_t conductor_pause = 0;
  std::uint64_t missed_event = 0;  ///< of events: the node's control queue is half full
  std::uint64_t disk_full = 0;     ///< of times that the hub keeps its state
  std::uint64_t hub_kills = 0;     ///< in all
  std::uint64_t hub_drains = 0;    ///< in all, the one at the end apart

  [[nodiscard]] static Plan draw(Random& random, std::size_t nodes);
};

/// A kind of fault that can be taken out of a world, to see whether it breaks without it, too.
struct Fault {
  std::string_view name;
  std::uint64_t Plan::* likelihood;
};
inline constexpr std::array<Fault, 29> kFaults = {{
    {"hub_kills", &Plan::hub_kills},
    {"hub_drains", &Plan::hub_drains},
    {"crash", &Plan::crash},
    {"vanish", &Plan::vanish},
    {"hang", &Plan::hang},
    {"goodbye", &Plan::goodbye},
    {"twin", &Plan::twin},
    {"misconduct", &Plan::misconduct},
    {"administers", &Plan::administers},
    {"flood", &Plan::flood},
    {"bad_token", &Plan::bad_token},
    {"lost_token", &Plan::lost_token},
    {"rename", &Plan::rename},
    {"slow_reader", &Plan::slow_reader},
    {"bad_configuration", &Plan::bad_configuration},
    {"latest", &Plan::latest},
    {"sync", &Plan::sync},
    {"retain", &Plan::retain},
    {"terms", &Plan::terms},
    {"late_credit", &Plan::late_credit},
    {"stall", &Plan::stall},
    {"clog", &Plan::clog},
    {"shard_pause", &Plan::shard_pause},
    {"missed_event", &Plan::missed_event},
    {"conductor_pause", &Plan::conductor_pause},
    {"disk_full", &Plan::disk_full},
    {"nameless", &Plan::nameless},
    {"waits_away", &Plan::waits_away},
}};
/// A set of faults, by their places in kFaults.
using Faults = std::bitset<kFaults.size()>;

}  // namespace gimnet::sim
