#include <map>
#include <string>

#include "tests/sim/routes/world.hpp"

// Names: nodes that take, leave and lose them at their hubs, and the checks of all copies.

namespace gimnet::sim::routes {
namespace {

namespace route = proto::route;

constexpr std::uint64_t kSharedNames = 12;
/// More than all names of a world.
constexpr std::size_t kNamesBytesMax = std::size_t{4} << 20;

std::string own_name(const HubPlan& plan, std::uint32_t index) {
  return "hall-" + std::to_string(plan.unique) + "/" + std::to_string(index);
}

route::NameClaim claim_of(HubId hub, std::uint32_t node, route::NameState state) {
  route::NameClaim claim;
  claim.node = make_id<NodeId>(hub, node);
  claim.state = state;
  return claim;
}

/// All names that a hub knows and may be asked for.
std::map<std::pair<std::string, HubId>, route::NameClaim> names_at(const hub::NameCopies& copies) {
  std::map<std::pair<std::string, HubId>, route::NameClaim> names;
  const auto add = [&names](const hub::KnownName& known) {
    if (known.standing != proto::ns::NameStanding::unreachable)
      names[{std::string{known.name}, known.hub}] = *known.claim;
  };
  NodeId node;
  while (const auto known = copies.node_after(node)) {
    add(*known);
    node = known->claim->node;
  }
  GroupId group;
  while (const auto known = copies.group_after(group)) {
    add(*known);
    group = known->claim->service->group;
  }
  return names;
}

}  // namespace

void World::start_names(std::size_t hub) {
  Hub& each = hubs_[hub];
  hub::NameCopies::Options options{{each.state->self().key.hub, each.state->self().instance}};
  options.grace = milliseconds(plan_.grace_ms);
  options.bytes_max = kNamesBytesMax;
  each.names = std::make_unique<hub::NameExchange>(options);
  each.nodes.clear();
  for (std::uint32_t index = 1; index <= plan_.names; ++index)
    each.nodes[own_name(each.plan, index)] = {index, route::NameState::held};
  put_names(hub);
}

void World::put_names(std::size_t hub) {
  Hub& each = hubs_[hub];
  const HubId id = each.state->self().key.hub;
  for (const auto& [name, node] : each.nodes)
    each.names->put_own(name, claim_of(id, node.index, node.state));
}

/// A node takes a name, loses its connection, comes back or leaves.
void World::change_a_name() {
  const auto hub = static_cast<std::size_t>(random_.below(hubs_.size()));
  const std::string name = "robot-" + std::to_string(random_.below(kSharedNames));
  const auto index = static_cast<std::uint32_t>(1'000 + ++last_number_ % 100'000);
  Hub& each = hubs_[hub];
  if (!each.state) return;
  const auto mine = each.nodes.find(name);
  if (mine == each.nodes.end()) {
    const auto known = each.names->copies().find(name);
    if (known && known->standing == proto::ns::NameStanding::held)
      return census_.note(Event::refused_name);
    if (known && known->standing == proto::ns::NameStanding::unreachable && random_.chance(500))
      return;
    if (known) census_.note(Event::took_over);
    each.nodes[name] = {index, route::NameState::held};
  } else if (random_.chance(500)) {
    each.nodes.erase(mine);
    each.names->remove_own(name);
  } else {
    auto& state = mine->second.state;
    state = state == route::NameState::held ? route::NameState::away : route::NameState::held;
  }
  put_names(hub);
  turn(hub);
}

void World::turn_names(std::size_t hub) {
  Hub& each = hubs_[hub];
  each.names->set_reachable(each.state->map(), each.state->store(), now());
  each.names->advance(now());
  for (const hub::KnownName& lost : each.names->take_lost()) {
    census_.note(Event::lost_name);
    const std::string name{lost.name};
    each.nodes.erase(name);
    each.names->remove_own(name);
  }
  each.names->advance(now());
  (void)each.names->take_changes();
  if (each.names->copies().bytes() > kNamesBytesMax)
    fail(Checker::names_bounded, "hub " + std::to_string(hub) + " has too many names");
  for (const hub::Sending& sending : each.names->take_sendings()) {
    ++records_sent_;
    const std::size_t wire = sending.link.value() - 1;
    pass(wire, wires_[wire].ends[0].hub == hub ? 1 : 0, {sending.bytes, 0});
  }
}

/// Of NAMES only so many are under way.
void World::count_names(End& target, std::uint64_t connection, const Message& message, int more) {
  if (message.bytes == nullptr ||
      proto::split_control(*message.bytes)->header.operation != route::Names::kOperation)
    return;
  if (std::exchange(target.names_connection, connection) != connection) target.names = 0;
  target.names += more;
  if (target.names > static_cast<int>(route::kNamesWindow))
    fail(Checker::names_bounded, std::to_string(target.names) + " NAMES are under way on a link");
}

void Settled::check_names(std::size_t hub) {
  const auto& mine = *world_.hubs_[hub].names;
  const auto all = names_at(mine.copies());
  if (all != names_at(world_.hubs_[component_[hub]].names->copies()))
    world_.fail(Checker::equal_names, "hub " + std::to_string(hub) + " has other names");
  for (const auto& [name, node] : world_.hubs_[hub].nodes) {
    const auto known = mine.copies().find(name);
    if (!known || known->hub != world_.identity(hub).key.hub)
      world_.fail(Checker::one_owner, name + " has two owners");
  }
  for (auto each = all.begin(); each != all.end(); ++each) {
    const auto next = std::next(each);
    if (next != all.end() && next->first.first == each->first.first)
      world_.fail(Checker::one_owner, each->first.first + " has two owners in one network");
  }
}

}  // namespace gimnet::sim::routes
