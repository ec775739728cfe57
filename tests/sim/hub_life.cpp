#include "tests/sim/hub_life.hpp"

namespace gimnet::sim {

namespace {

hub::HubFacts facts(const Setting& setting) {
  hub::HubFacts facts;
  facts.id = HubLife::kHub;
  facts.name = "simulated";
  facts.version = "0";
  facts.shards = setting.plan.shards;
  facts.started = setting.agenda.now_ms();
  return facts;
}

/// For the trace: what a command says, without places in memory.
struct TraceCommand {
  Trace& trace;
  std::uint64_t shard;
  void operator()(const hub::AttachCommand& command) const {
    trace.note("conductor: shard {a}, attach node {b} by its connection {c}", shard,
               index_of(command.node), command.attachment, command.welcome.name);
    trace.mix(command.welcome.token);
  }
  void operator()(const hub::SendControlCommand& command) const {
    const auto view = proto::split_control(std::span{command.frame}.subspan(proto::kHeaderSize));
    trace.note("conductor: shard {a}, say operation {b} to node {c}", shard,
               view->header.operation & 0x7FFFu,
               index_of(NodeId{proto::load_header(command.frame.data()).dst}));
    trace.mix(command.frame);
  }
  void operator()(const hub::CloseCommand& command) const {
    trace.note("conductor: shard {a}, close slot {b} with code {c}: {t}", shard,
               command.session.slot.value(), static_cast<std::uint64_t>(command.code),
               command.sentence);
  }
  void operator()(const hub::ReleaseCommand& command) const {
    trace.note("conductor: shard {a}, release slot {b} of generation {c}", shard,
               command.session.slot.value(), command.session.generation);
  }
  void operator()(const hub::RenumberCommand& command) const {
    trace.note("conductor: shard {a}, slot {b} is node {c} now", shard,
               command.session.slot.value(), index_of(command.node));
  }
  void operator()(const hub::DrainCommand&) const {
    trace.note("conductor: shard {a}, drain", shard);
  }
  template <class Other>
  void operator()(const Other&) const {
    trace.note("conductor: shard {a}, another command", shard);
  }
};

}  // namespace

HubLife::HubLife(Setting& setting, const Around& around, const hub::HubStart& start, Past past)
    : setting_(setting),
      quiescence_(setting.plan.shards),
      readable_([this, &setting] {
        std::vector<const hub::ShardCounters*> list;
        for (std::size_t i = 0; i < setting.plan.shards; ++i) list.push_back(&counters_[i]);
        return list;
      }()),
      model_(setting.plan.limits, setting.census, kHub, std::move(past)),
      shards_(setting, {kHub, setting.plan.shards, nodes_, groups_, quiescence_, around.network,
                        around.conductor_wanted,
                        [this](ShardIndex shard, const hub::ShardCommand& command) {
                          checks_.before_it_leaves(shard, command);
                        },
                        around.is_slow}),
      checks_({nodes_, groups_, shards_, kHub, model_.limits()}, model_),
      limits_(setting.plan.limits),
      conductor_(
          facts(setting), hub::Placement::spread, limits_,
          hub::Conductor::Wiring{shards_,
                                 {nodes_, groups_, quiescence_},
                                 readable_,
                                 start,
                                 [this, keep = around.keep_state](const hub::HubState& state) {
                                   std::string error = keep(state);
                                   kept_ = error.empty();
                                   if (kept_) model_.kept(state, setting_.agenda.now_ms());
                                   if (!kept_) model_.keeping_failed();
                                   return error;
                                 },
                                 {},
                                 nullptr,
                                 [this] { return read_again(); },
                                 {}}) {
  checks_.watch(conductor_);
  shards_.believe(model_);
}

hub::Reloading HubLife::read_again() {
  Random& random = setting_.random;
  hub::Reloading reloading;
  reloading.log_level = LogLevel::off;
  if (random.chance(setting_.plan.bad_configuration)) {
    reloading.faults.emplace_back("a key that there is not");
    model_.configuration(std::nullopt);
    return reloading;
  }
  reloading.limits = limits_;
  reloading.limits.services_per_node = random.between(2, 6);
  reloading.limits.subscriptions_per_node = random.between(2, 8);
  reloading.limits.page_records = random.between(4, 40);
  reloading.limits.declarations_burst = random.between(1, 40);
  model_.configuration(reloading.limits);
  return reloading;
}

void HubLife::after_step() {
  model_.step_over(kept_);
  checks_.after_step(setting_.agenda.now_ms());
}

void HubLife::trace_sent() {
  for (const SimShards::Sent& sent : shards_.sent()) {
    std::visit(TraceCommand{setting_.trace, sent.shard.value()}, *sent.command);
  }
}

hub::PeerInfo HubLife::peer_of(const hub::Identity& identity, std::uint32_t node,
                               std::uint64_t wire) {
  constexpr std::uint32_t kOverLoopback = 10;
  if (identity.is_user())
    return {"unix", "pid " + std::to_string(wire + 1) + " " + identity.text()};
  const bool loopback = node % kOverLoopback == 0;
  return {"tcp", (loopback ? "127.0.0.1:" : "10.0.0.1:") + std::to_string(wire)};
}

std::optional<proto::Goodbye> HubLife::admit(const Newcomer& newcomer, std::uint64_t number) {
  hub::Stranger stranger;
  stranger.transport = std::make_unique<WireStream>(newcomer.wire);
  stranger.peer = peer_of(newcomer.identity, newcomer.wire->node, newcomer.wire->number);
  const milliseconds now = setting_.agenda.now_ms();
  shards_.forget_sent();
  stranger.identity = newcomer.identity;
  stranger.rights.administer = newcomer.identity == kAdministrator;
  const std::int64_t wall = wall_ns(setting_);
  const auto refusal = conductor_.admit(stranger, newcomer.hello, {now, wall});
  const Model::Hello hello{newcomer.hello,    stranger.rights.administer,     stranger.peer.address,
                           newcomer.identity, milliseconds{wall / 1'000'000}, number};
  trace_sent();
  if (refusal) {
    setting_.trace.note("conductor: refuses wire {a} with code {b}: {t}", newcomer.wire->number,
                        static_cast<std::uint64_t>(refusal->code), 0, refusal->sentence);
    model_.refused(hello, *refusal, now);
  } else {
    const hub::AttachCommand* attach = nullptr;
    for (const SimShards::Sent& sent : shards_.sent()) {
      if (const auto* found = std::get_if<hub::AttachCommand>(sent.command)) attach = found;
    }
    require(attach != nullptr, Checker::seam,
            "somebody is let in, and no shard is given the connection");
    model_.admitted(hello, *attach, now);
    newcomer.wire->session = model_.session_of(index_of(attach->node));
  }
  after_step();
  return refusal;
}

void HubLife::take_event(std::size_t shard) {
  hub::ShardEvent event = shards_.take_event(shard);
  const milliseconds now = setting_.agenda.now_ms();
  shards_.forget_sent();
  hub::ControlFrameEvent asked;
  hub::DetachedEvent ended;
  const auto* frame = std::get_if<hub::ControlFrameEvent>(&event.what);
  const auto* detached = std::get_if<hub::DetachedEvent>(&event.what);
  if (frame != nullptr) {
    asked = *frame;
    setting_.trace.note("conductor: shard {a} has {b} bytes from node {c}", shard,
                        frame->frame.size(), index_of(frame->node));
    setting_.trace.mix(frame->frame);
  } else if (detached != nullptr) {
    ended = *detached;
    setting_.trace.note("conductor: shard {a} lost connection {b} of node {c}: {t}", shard,
                        detached->attachment, index_of(detached->node), detached->sentence);
  }
  const bool is_frame = frame != nullptr;
  const bool is_end = detached != nullptr;
  conductor_.on_event(std::move(event), now);
  trace_sent();
  if (is_frame) {
    const hub::SendControlCommand* answer = nullptr;
    bool closed = false;
    for (const SimShards::Sent& sent : shards_.sent()) {
      const auto* closing = std::get_if<hub::CloseCommand>(sent.command);
      closed = closed || (closing != nullptr && closing->code == proto::GoodbyeCode::oddities);
      const auto* control = std::get_if<hub::SendControlCommand>(sent.command);
      if (control == nullptr || control->answers == 0) continue;
      require(answer == nullptr, Checker::answers, "a request is answered twice");
      answer = control;
    }
    model_.asked(asked, answer, closed, now);
  } else if (is_end) {
    model_.detached(ended, now);
  }
  after_step();
}

void HubLife::stood_still(milliseconds time) {
  setting_.trace.note("conductor: stood still for {a} ms",
                      static_cast<std::uint64_t>(time.count()));
  conductor_.stood_still(time, setting_.agenda.now_ms());
  model_.stood_still(time, setting_.agenda.now_ms());
}

void HubLife::tick() {
  const bool garbage = conductor_.has_garbage();
  const milliseconds now = setting_.agenda.now_ms();
  shards_.forget_sent();
  setting_.trace.note("conductor: looks at its clock");
  conductor_.tick(now);
  trace_sent();
  model_.ticked(now);
  after_step();
  if (garbage && !conductor_.has_garbage()) setting_.census.add(Happening::garbage_freed);
}

bool HubLife::tell_rest() {
  shards_.forget_sent();
  const bool more = conductor_.tell_rest(setting_.agenda.now_ms());
  trace_sent();
  after_step();
  if (conductor_.tells_later()) setting_.census.add(Happening::told_later);
  return more;
}

void HubLife::drain() {
  drains_ = true;
  model_.draining();
  shards_.forget_sent();
  conductor_.drain();
  trace_sent();
  checks_.after_drain();
  after_step();
}

}  // namespace gimnet::sim
