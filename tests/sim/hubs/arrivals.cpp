#include <algorithm>
#include <array>
#include <set>
#include <utility>

#include "base/ids.hpp"
#include "tests/sim/hubs/world.hpp"

// Looks at a world that was left alone: names, and whether everybody reaches everybody.

namespace gimnet::sim::hubs {
namespace {

/// To so many others each node sends; in a small world, to all.
constexpr std::size_t kSendsMost = 40;
constexpr std::size_t kSendsOfAllMost = 2'000;
/// Names that are asked for at each hub, beside those that several nodes want.
constexpr std::size_t kNamesMost = 12;
constexpr std::uint64_t kFrameBytesMost = 140;
/// Control frames that a link carries meanwhile.
constexpr std::uint64_t kBytesAhead = 10'000;

std::uint64_t hop_limits(const hub::ShardCounters& counters) {
  return counters.dropped[static_cast<std::size_t>(proto::DropReason::hop_limit)].value();
}

}  // namespace

void Settled::ask_names() {
  for (const SimNode& node : world_.nodes_) {
    const bool shared = node.plan().name.starts_with("shared");
    const bool known = std::ranges::find(names_, node.plan().name) != names_.end();
    if (!known && (shared || names_.size() < kNamesMost)) names_.push_back(node.plan().name);
  }
  for (SimNode& person : world_.operators_) {
    if (!person.is_up())
      broken(Checker::reachable, "hub " + std::to_string(person.plan().hub) +
                                     " serves nobody: its operator " + person.last());
    for (const std::string& name : names_) person.resolve(name, {});
  }
}

void Settled::check_names() {
  for (const std::string& name : names_) {
    for (SimNode& person : world_.operators_) {
      std::vector<NodeId> owners;
      for (const SimNode& node : world_.nodes_) {
        const bool near = distance_[person.plan().hub][node.at()] >= 0;
        if (near && node.is_up() && node.name() == name) owners.push_back(node.id());
      }
      const std::string words = "'" + name + "' at hub " + std::to_string(person.plan().hub);
      if (owners.size() > 1) broken(Checker::one_owner, words + " has two owners");
      const auto said = person.resolved().find(name);
      if (said == person.resolved().end()) broken(Checker::answered, "nobody answers for " + words);
      const NodeId owner = owners.empty() ? NodeId{} : owners.front();
      if (said->second != owner)
        broken(Checker::one_owner, words + " is said to be of " + to_string(said->second) +
                                       " and is of " + to_string(owner));
    }
  }
}

void Settled::send_to_all() {
  std::uint64_t limits = 0;
  for (const Machine& machine : world_.machines_) limits += hop_limits(machine.hub->counters());
  std::vector<SimNode*> up;
  for (SimNode& node : world_.operators_) up.push_back(&node);
  for (SimNode& node : world_.nodes_)
    if (node.is_up()) up.push_back(&node);
  const std::size_t most = std::clamp<std::size_t>(kSendsOfAllMost / up.size(), 1, kSendsMost);
  for (SimNode* from : up) {
    std::size_t sent = 0;
    const auto first = static_cast<std::size_t>(world_.random_.below(up.size()));
    for (std::size_t i = 0; i < up.size() && sent < most; ++i) {
      const SimNode& to = *up[(first + i) % up.size()];
      const int links = distance_[from->at()][to.at()];
      if (&to == from || links < 0 || links > proto::kHopsMax) continue;
      const auto number = from->send_to(to.id());
      if (!number)
        broken(Checker::resumes,
               "node " + from->plan().name + " is still paused for " + to_string(to.id()));
      pairs_.push_back({from, &to, *number});
      ++sent;
    }
  }
  std::uint64_t enough_ms = 1'000 + kSlowestMs * distance_.size();
  for (const Wire& wire : world_.wires_) {
    if (wire.plan.bytes_per_ms == 0) continue;
    const std::uint64_t bytes = kBytesAhead + pairs_.size() * kFrameBytesMost;
    enough_ms = std::max(enough_ms, bytes / wire.plan.bytes_per_ms);
  }
  world_.run_until(world_.now() + milliseconds{enough_ms});
  std::uint64_t later = 0;
  for (const Machine& machine : world_.machines_) later += hop_limits(machine.hub->counters());
  if (later != limits) broken(Checker::no_loop, "frames are still dropped for their hops");
}

void Settled::check_arrivals() const {
  const auto title = [](const SimNode& node) {
    return node.plan().name + " at hub " + std::to_string(node.at()) +
           (node.is_up() ? "" : ", which is down") +
           (node.last().empty() ? "" : ", which " + node.last());
  };
  for (const Pair& pair : pairs_) {
    if (world_.book_.has_arrived(pair.number)) continue;
    broken(Checker::reachable, "frame " + std::to_string(pair.number) + " of " + title(*pair.from) +
                                   " does not come to " + title(*pair.to) + drops());
  }
}

/// Why frames were dropped at all hubs, in words.
std::string Settled::drops() const {
  std::string words;
  for (std::size_t reason = 0; reason < proto::kDropReasonCount; ++reason) {
    std::uint64_t dropped = 0;
    for (const Machine& machine : world_.machines_)
      dropped += machine.hub->counters().dropped[reason].value();
    if (dropped != 0)
      words += std::string{", "} + proto::drop_reason_name(static_cast<proto::DropReason>(reason)) +
               " " + std::to_string(dropped);
  }
  return words;
}

void Settled::check_rest() {
  for (const SimNode& node : world_.nodes_)
    if (node.is_up() && node.is_paused())
      broken(Checker::resumes, "node " + node.plan().name + " stays paused");
  for (const Machine& machine : world_.machines_) {
    for (const auto& connection : machine.hub->shard().connections) {
      if (connection == nullptr || !connection->connected) continue;
      if (connection->holds != 0 || connection->outbox.paused_anyone())
        broken(Checker::resumes, "a connection is held, or holds others");
    }
    const auto ended = std::ranges::count_if(
        machine.hub->links().all(), [](const auto& each) { return each.second->is_over(); });
    if (ended > static_cast<std::ptrdiff_t>(hub::LinkRoster::kEndedMost))
      broken(Checker::bounded, "a hub keeps too many links that nobody dials");
    std::set<std::pair<std::string, std::array<std::uint8_t, 16>>> accepted;
    for (const auto& [number, link] : machine.hub->links().all()) {
      if (link->is_dialled() || !link->peer()) continue;
      if (!accepted.emplace(link->name(), link->peer()->hub.unique.bytes).second)
        broken(Checker::bounded, "a hub keeps a link twice");
    }
    const hub::ShardCounters& counters = machine.hub->counters();
    if (counters.dropped[static_cast<std::size_t>(proto::DropReason::link_unsure)].value() != 0)
      world_.census_.note(Event::unsure);
  }
}

/// delivered(A) <= accepted(B) <= delivered(A) + unsure(A), over all sessions that both ends know.
void Settled::check_ledgers() const {
  for (std::size_t index = 0; index < world_.wires_.size(); ++index) {
    const Wire& wire = world_.wires_[index];
    const SimHub* const hubs[] = {world_.machines_[wire.plan.dialler].hub.get(),
                                  world_.machines_[wire.plan.acceptor].hub.get()};
    hub::SessionCounts counts[2];
    bool stands = true;
    for (const std::size_t end : {std::size_t{0}, std::size_t{1}}) {
      const hub::HubLink* const link = world_.find_link(index, end);
      stands = stands && link != nullptr && link->connected();
      if (!stands) break;
      counts[end] = hubs[end]->links().totals().of(link->number());
      if (counts[end].accepted != 0) world_.census_.note(Event::counted_on);
      counts[end] += hubs[end]->counts(*link->place);
    }
    for (const std::size_t end : {std::size_t{0}, std::size_t{1}}) {
      const std::uint64_t accepted = counts[1 - end].accepted;
      const std::uint64_t most = counts[end].delivered + counts[end].unsure;
      if (!stands || (counts[end].delivered <= accepted && accepted <= most)) continue;
      broken(Checker::ledgers, "wire " + std::to_string(index) + ": " +
                                   std::to_string(counts[end].delivered) + " delivered, " +
                                   std::to_string(counts[end].unsure) + " unsure, " +
                                   std::to_string(accepted) + " accepted");
    }
  }
}

}  // namespace gimnet::sim::hubs
