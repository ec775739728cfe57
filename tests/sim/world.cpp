#include "tests/sim/world.hpp"

#include <algorithm>
#include <set>

namespace gimnet::sim {

using proto::GoodbyeCode;
using namespace std::chrono_literals;

World::World(const Options& options)
    : options_(options),
      setting_(Random(options.seed, options.choices), options.nodes, options.without,
               options.print),
      network_(setting_) {
  network_.connect({[this](Wire& wire) { life_->shards().has_something(wire); },
                    [this](const WirePointer& wire, const Bytes& frame) {
                      nodes_[wire->node]->hears(wire, frame);
                    },
                    [this](const WirePointer& wire) { nodes_[wire->node]->sees_the_end(wire); }});
  begin_life(make_disk());
  const SimNode::Around around{
      setting_, network_,
      [this](const WirePointer& wire, const proto::Hello& hello, const hub::Identity& identity) {
        say_hello(wire, hello, identity);
      },
      [this](const WirePointer& wire, bool mute) { life_->shards().set_mute(wire, mute); }};
  for (std::uint32_t i = 0; i < options.nodes; ++i) {
    nodes_.push_back(std::make_unique<SimNode>(around, i));
    nodes_.back()->start();
  }
  plan_endings();
}

namespace {

/// Some worlds come to the end of the indices, and begin again at 1; those who had the first ones
/// may still have them.
void draw_used(Random& random, std::uint32_t& mark, hub::IndexSet& used, GivenIds& given) {
  constexpr std::uint32_t kLast = kEveryIndex - 1;
  const auto left = static_cast<std::uint32_t>(random.between(1, 400));
  const auto low = static_cast<std::uint32_t>(random.between(0, 5'000));
  const bool at_the_end = random.chance(500);
  const bool few = random.chance(200);
  if (!at_the_end) return;
  mark = kLast - left;
  given.old = few ? mark - 1 : low;
  for (std::uint32_t index = 1; index <= given.old; ++index) used.insert(index);
}

}  // namespace

Past World::make_disk() {
  Random& random = setting_.random;
  for (std::byte& each : disk_.secret) each = static_cast<std::byte>(random.below(256));
  disk_.boot = random.below(1'000);
  Past past;
  draw_used(random, disk_.node_mark, disk_.nodes_used, past.nodes);
  if (random.chance(500))
    disk_.group_mark = kEveryIndex - 1 - static_cast<std::uint32_t>(random.between(1, 400));
  return past;
}

/// A disk that is full now and then.
std::string World::keep(const hub::HubState& state) {
  if (setting_.random.chance(setting_.plan.disk_full)) {
    setting_.census.add(Happening::state_not_kept);
    return "the disk is full";
  }
  setting_.census.add(Happening::state_kept);
  disk_ = state;
  return {};
}

void World::begin_life(Past past) {
  ++lives_;
  Result<hub::HubStart> start =
      hub::next_start(disk_, milliseconds{HubLife::wall_ns(setting_) / 1'000'000});
  require(start.has_value(), Checker::convergence, "the hub cannot start again");
  disk_ = start->state;
  if (disk_.boot > 1)
    past.returns_until = setting_.agenda.now_ms() + milliseconds{setting_.plan.limits.grace_ms};
  past.nodes.used = start->nodes.used;
  // Fewer than a real start grants, so that more are asked for.
  for (hub::IndexRange* range : {&start->nodes, &start->groups}) {
    const std::uint64_t fewer = hub::IndexPool::kBlock / 2 - setting_.random.between(1, 200);
    if (range->count >= hub::IndexPool::kBlock) range->count -= fewer;
  }
  life_ = std::make_unique<HubLife>(
      setting_,
      HubLife::Around{network_, [this] { want_conductor(Time{0}); },
                      [this](std::uint32_t node) { return nodes_[node]->is_slow(); },
                      [this](const hub::HubState& state) { return keep(state); }},
      *start, std::move(past));
}

void World::plan_endings() {
  const auto until = static_cast<std::uint64_t>(setting_.plan.faults_until.count());
  for (std::uint64_t i = 0; i < setting_.plan.hub_kills; ++i) {
    setting_.agenda.at(Time{setting_.random.between(until / 8, until)}, [this] { kill_hub(); });
  }
  for (std::uint64_t i = 0; i < setting_.plan.hub_drains; ++i) {
    setting_.agenda.at(Time{setting_.random.between(until / 8, until)}, [this] { want_drain(); });
  }
}

void World::kill_hub() {
  if (down_) return;
  setting_.trace.note("the hub is killed and starts again");
  setting_.census.add(Happening::hub_killed);
  stop_hub();
  start_hub();
}

void World::stop_hub() {
  down_ = true;
  life_->shards().die();
  for (const HubLife::Newcomer& newcomer : newcomers_) network_.close_by_hub(newcomer.wire);
  newcomers_.clear();
  clock_.reset();
  clock_due_ = false;
  telling_due_ = false;
}

void World::start_hub() {
  down_ = false;
  // Frames on their way to the old life find their wires closed. The old shards stay until then.
  dead_.push_back(std::move(life_));
  Past past = dead_.back()->model().past();
  // A kick while the disk was full is forgotten.
  std::erase_if(past.kicked, [this](const Kicked& one) {
    return std::none_of(disk_.kicked.begin(), disk_.kicked.end(),
                        [&one](const hub::SessionToken& kept) {
                          return kept.index.value() == one.index && kept.expiry == one.expiry;
                        });
  });
  begin_life(std::move(past));
}

void World::want_drain() {
  if (down_ || life_->drains()) return;
  const std::uint64_t first = setting_.random.below(nodes_.size());
  const bool by_signal = setting_.random.chance(400);
  for (std::size_t i = 0; i < nodes_.size() && !by_signal; ++i) {
    if (nodes_[(first + i) % nodes_.size()]->order_drain()) return;
  }
  setting_.census.add(Happening::drain_by_signal);
  begin_drain();
}

void World::begin_drain() {
  setting_.trace.note("the hub drains");
  life_->drain();
  want_conductor(Time{0});
}

void World::look_at_drain() {
  if (life_->conductor().drain_wanted() && !life_->drains()) {
    // The other events of its batch come first.
    for (auto shards = life_->shards().with_events();
         !shards.empty() && setting_.random.chance(500); shards = life_->shards().with_events()) {
      ++steps_;
      life_->take_event(setting_.random.pick(shards));
    }
    begin_drain();
  }
  if (!life_->conductor().drained()) return;
  const auto& sessions = life_->model().sessions();
  const bool all_gone = std::none_of(sessions.begin(), sessions.end(),
                                     [](const auto& entry) { return entry.second.connected; });
  require(all_gone, Checker::drain, "the hub ends before everybody has gone");
  if (last_life_) return;
  setting_.trace.note("the hub has drained and ends");
  setting_.census.add(Happening::drained_in_life);
  stop_hub();
  setting_.agenda.after(Time{setting_.random.between(1'000, 500'000)}, [this] {
    setting_.trace.note("the hub starts again");
    start_hub();
  });
}

void World::say_hello(const WirePointer& wire, const proto::Hello& hello,
                      const hub::Identity& identity) {
  setting_.agenda.at(network_.arrival(wire->next_at_hub),
                     [this, wire, hello, identity, life = lives_] {
                       if (life != lives_ || down_) return network_.close_by_hub(wire);
                       newcomers_.push_back({wire, hello, identity});
                       want_conductor(Time{0});
                     });
}

void World::want_conductor(Time delay) {
  if (turn_due_) return;
  turn_due_ = true;
  Time time = delay + Time{setting_.random.between(1, 200)};
  if (setting_.random.chance(setting_.plan.conductor_pause) &&
      setting_.agenda.now() < setting_.plan.faults_until) {
    time += Time{setting_.random.between(10'000, 400'000)};
    setting_.census.add(Happening::conductor_paused);
    setting_.trace.note("the conductor pauses for {a} us",
                        static_cast<std::uint64_t>(time.count()));
  }
  setting_.agenda.after(time, [this] {
    turn_due_ = false;
    conductor_turn();
  });
}

void World::conductor_turn() {
  if (down_) return;
  look_whether_it_stood();
  enum class Choice { clock, newcomer, event, telling };
  std::vector<Choice> choices;
  const std::vector<std::size_t> shards = life_->shards().with_events();
  if (clock_due_) choices.push_back(Choice::clock);
  if (!newcomers_.empty()) choices.push_back(Choice::newcomer);
  if (!shards.empty()) choices.push_back(Choice::event);
  if (telling_due_) choices.push_back(Choice::telling);
  if (choices.empty()) return;
  ++steps_;
  bool more_to_tell = life_->has_to_tell();
  switch (setting_.random.pick(choices)) {
    case Choice::clock:
      clock_due_ = false;
      clock_.reset();
      life_->tick();
      break;
    case Choice::newcomer:
      admit();
      break;
    case Choice::event:
      life_->take_event(setting_.random.pick(shards));
      look_at_drain();
      if (down_) return;
      more_to_tell = life_->has_to_tell();
      break;
    case Choice::telling:
      more_to_tell = life_->tell_rest();
      break;
  }
  telling_due_ = more_to_tell;
  arm_clock();
  if (choices.size() > 1 || telling_due_ || !newcomers_.empty() ||
      !life_->shards().with_events().empty())
    want_conductor(Time{0});
}

void World::admit() {
  const auto chosen = static_cast<std::ptrdiff_t>(setting_.random.below(newcomers_.size()));
  const HubLife::Newcomer newcomer = newcomers_[static_cast<std::size_t>(chosen)];
  newcomers_.erase(newcomers_.begin() + chosen);
  const auto refusal = life_->admit(newcomer, sessions_ + 1);
  ++sessions_;
  if (!refusal) return;
  network_.to_node(newcomer.wire, link_frame(NodeId{}, HubLife::kHub, proto::encode(*refusal)));
  network_.close_by_hub(newcomer.wire);
}

// As the conductor's loop does it (hub/control/conductor_loop.cpp).

void World::look_whether_it_stood() {
  if (!clock_) return;
  const milliseconds stood =
      setting_.agenda.now_ms() - std::chrono::duration_cast<milliseconds>(*clock_);
  if (stood <= hub::Conductor::kLookEvery) return;
  clock_ = setting_.agenda.now();
  life_->stood_still(stood);
}

void World::arm_clock() {
  std::optional<milliseconds> deadline = life_->conductor().next_deadline();
  const milliseconds collect = setting_.agenda.now_ms() + 20ms;
  if (life_->conductor().has_garbage() && (!deadline || collect < *deadline)) deadline = collect;
  if (!deadline) return;
  deadline = std::min(*deadline, setting_.agenda.now_ms() + hub::Conductor::kLookEvery);
  const Time time = *deadline + 1ms;
  if (clock_ && *clock_ <= time) return;
  clock_ = time;
  setting_.agenda.at(time, [this, time, life = lives_] {
    if (life != lives_ || down_ || clock_ != time) return;
    clock_due_ = true;
    want_conductor(Time{0});
  });
}

Report World::run() {
  Report report;
  report.seed = options_.seed;
  try {
    live();
    converge();
    drain_for_good();
  } catch (const Broken& broken) {
    report.broken = broken;
    report.last = setting_.trace.last();
  }
  report.hash = setting_.trace.hash();
  report.events = setting_.trace.events();
  report.steps = steps_;
  report.census = setting_.census;
  return report;
}

void World::live() {
  while (setting_.agenda.step(setting_.plan.end)) {
  }
}

/// The faults stopped long ago: everybody who can be served is.
void World::converge() {
  require(newcomers_.empty() && life_->shards().idle(), Checker::convergence,
          "something waits to be done for ever");
  life_->shards().require_at_rest();
  require(!life_->conductor().has_garbage(), Checker::convergence,
          "lists that nobody reads any more are not freed");
  std::set<std::uint32_t> up;
  for (const auto& node : nodes_) {
    require_served(*node);
    if (!node->is_up()) continue;
    up.insert(index_of(node->id()));
    require_agreed(*node);
  }
  for (const auto& [index, session] : life_->model().sessions()) {
    if (!up.contains(index))
      broken(Checker::convergence,
             "node " + std::to_string(index) + " is a session without a program");
  }
  require(life_->shards().connected() == up.size(), Checker::convergence,
          "there are connections without a program");
}

void World::require_served(const SimNode& node) const {
  if (node.is_up()) {
    return require(!node.waits_for_answers(), Checker::answers,
                   "a node waits for an answer that does not come");
  }
  const std::string place = HubLife::peer_of(node.identity(), node.number(), 0).address;
  const std::string crowd = Model::crowd_of(place, node.identity() == kAdministrator);
  const bool room = life_->model().sessions().size() < setting_.plan.limits.nodes &&
                    !life_->model().has_half(crowd);
  const bool refused = node.refusal() == GoodbyeCode::name_taken ||
                       (node.refusal() == GoodbyeCode::hub_full && !room);
  if (refused) return;
  broken(Checker::convergence, "program " + std::to_string(node.number()) + ", last refused with " +
                                   proto::goodbye_name(node.refusal()) +
                                   ", is not let in, and nothing stands in its way");
}

/// Requires that the node is right about itself and its services.
void World::require_agreed(const SimNode& node) const {
  const Model& model = life_->model();
  const std::uint32_t index = index_of(node.id());
  const auto session = model.sessions().find(index);
  if (session == model.sessions().end() || session->second.name != node.name()) {
    broken(Checker::convergence,
           "node " + std::to_string(index) + " believes that it is a member, and is not");
  }
  if (node.view() != nullptr) node.view()->require_agreed(model);
  for (const auto& [service, provided] : node.provides()) {
    const Model::Topic* topic = model.topic(node.name() + "/" + service);
    const bool same = topic != nullptr && topic->service && topic->service->provider == index &&
                      topic->service->group == index_of(provided.group);
    if (!same)
      broken(Checker::convergence,
             "node " + std::to_string(index) + " is wrong about its service " + service);
  }
  for (const auto& [full_name, subscribed_to] : node.subscribes()) {
    const Model::Topic* topic = model.topic(full_name);
    const bool subscribed = topic != nullptr && topic->subscribers.contains(index);
    if (!subscribed || model.state_of(*topic, index).group != subscribed_to.known.group ||
        model.state_of(*topic, index).provider != subscribed_to.known.provider) {
      broken(Checker::convergence,
             "node " + std::to_string(index) + " is wrong about the service " + full_name);
    }
  }
}

void World::drain_for_good() {
  last_life_ = true;
  begin_drain();
  const Time latest = setting_.agenda.now() + 2s;
  while (!life_->conductor().drained() && setting_.agenda.step(latest)) {
  }
  require(life_->conductor().drained(), Checker::convergence, "the hub does not end");
  setting_.census.add(Happening::drained);
}

}  // namespace gimnet::sim
