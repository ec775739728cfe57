#include "hub/control/conductor.hpp"

#include "base/check.hpp"
#include "base/endian.hpp"
#include "base/id_text.hpp"
#include "base/log.hpp"
#include "hub/control/dispatch.hpp"
#include "hub/shard/control_frame.hpp"
#include "proto/control/ns_register.hpp"
#include "proto/control/ns_watch.hpp"

namespace gimnet::hub {
namespace {

using proto::Goodbye;
using proto::GoodbyeCode;
using std::chrono::milliseconds;
namespace ns = proto::ns;

/// How long after the state could not be kept it is tried again.
constexpr milliseconds kKeepAgainAfter{1'000};

std::string title(NodeId node, const Session& session) {
  return "node " + to_string(node) + (session.name.empty() ? std::string{} : " '" + session.name + "'");
}

Sessions::Options sessions_options(const HubFacts& facts, Placement placement, const HubStart& start) {
  Sessions::Options options;
  options.hub = facts.id;
  options.shards = facts.shards;
  options.placement = placement;
  options.secret = start.state.secret;
  options.boot = start.state.boot;
  options.nodes = start.nodes;
  options.groups = start.groups;
  options.kicked = start.state.kicked;
  return options;
}

/// Never 0, and another one at each start, also of a hub that keeps nothing.
std::uint64_t epoch_of(const HubStart& start) {
  const std::uint64_t epoch = load_le<std::uint64_t>(start.state.unique_id.data()) + start.state.boot;
  return epoch != 0 ? epoch : 1;
}

SessionRef ref_of(const Place& place) { return SessionRef{place.slot, place.generation}; }

}  // namespace

Conductor::Conductor(HubFacts facts, Placement placement, Limits& limits, Wiring wiring)
    : facts_(std::move(facts)),
      limits_(limits),
      wiring_(std::move(wiring)),
      membership_(sessions_options(facts_, placement, wiring_.start), limits),
      watches_(HubTitle{facts_.id, facts_.name}, epoch_of(wiring_.start), limits),
      publisher_(facts_.id, facts_.shards, wiring_.tables),
      state_(wiring_.start.state) {
  GIMNET_CHECK(wiring_.shards.shards() == facts_.shards);
  if (state_.boot > 1) {
    wiring_.tables.nodes.expect_returns_below(wiring_.start.nodes.first);
    returns_until_ = facts_.started + milliseconds{limits_.grace_ms};
  }
}

std::optional<Goodbye> Conductor::admit(Stranger& stranger, const proto::Hello& hello, Moment moment) {
  if (draining_) return Goodbye{GoodbyeCode::draining, "the hub is shutting down; connect to another one"};
  JoinRequest request;
  request.role = hello.role;
  request.name = hello.name;
  request.token = hello.token;
  request.description = hello.description;
  request.shard_hint = hello.shard;
  request.origin = Origin{stranger.peer.transport, stranger.peer.address};
  request.may_administer = stranger.may_administer;
  request.identity = stranger.identity;
  request.wall = milliseconds{moment.wall_ns / 1'000'000};
  Effects effects;
  const auto joined = membership_.join(request, moment.now, effects);
  carry_out(effects, moment.now);
  if (!joined) return joined.error();
  attach(stranger, hello, *joined, moment);
  return std::nullopt;
}

void Conductor::attach(Stranger& stranger, const proto::Hello& hello, const Membership::Joined& joined, Moment moment) {
  Session& session = *joined.session;
  watches_.connection_ended(session.index);  // of one that this one replaces
  AttachCommand command;
  command.session = ref_of(session.place);
  command.attachment = session.attachment;
  command.node = node_id(session);
  command.new_session = joined.new_session;
  command.transport = std::move(stranger.transport);
  command.welcome = welcome(session, hello, moment);
  command.resume_wanted = hello.resume;
  command.peer_epoch = hello.epoch;
  command.known_hub_epoch = hello.resume_epoch;
  command.known_taken = hello.resume_taken;
  command.peer_resume_bytes = hello.resume_buffer_bytes;
  command.peer_frame_bytes = hello.frame_length_max;
  // Before the command, which lets WELCOME out: who has seen that can be reached. The id is nobody's before.
  publisher_.publish_node(session.index, membership_);
  wiring_.shards.send(session.place.shard, std::move(command));
  session.close_code.reset();
  session.close_sentence.clear();
  log_info(title(node_id(session), session) + (session.came_back ? " came back over " : " joined over ") +
           session.origin.transport + " from " + session.origin.address + ", shard " +
           std::to_string(session.place.shard.value()));
}

proto::Welcome Conductor::welcome(const Session& session, const proto::Hello& hello, Moment moment) const {
  proto::Welcome welcome;
  welcome.node = node_id(session);
  welcome.token = membership_.sessions().token_of(session);
  welcome.hub = facts_.id;
  welcome.hub_name = facts_.name;
  welcome.frame_length_max = static_cast<std::uint32_t>(limits_.frame_bytes);
  welcome.keep_alive_ms = static_cast<std::uint32_t>(limits_.keep_alive_ms);
  welcome.silent_ms = static_cast<std::uint32_t>(limits_.silent_ms);
  welcome.hub_time_ns = moment.wall_ns;
  welcome.resume_buffer_bytes = hello.resume ? static_cast<std::uint32_t>(limits_.resume_bytes) : 0;
  welcome.grace_ms = static_cast<std::uint32_t>(limits_.grace_ms);
  welcome.name = session.name;
  welcome.name_provisional = membership_.directory().is_provisional(session.name);
  if (session.close_code) {
    welcome.last_goodbye_code = static_cast<std::uint16_t>(*session.close_code);
    welcome.last_goodbye_sentence = session.close_sentence.substr(0, proto::kSentenceBytesMax);
  }
  return welcome;
}

void Conductor::on_event(ShardEvent event, milliseconds now) {
  if (const auto* frame = std::get_if<ControlFrameEvent>(&event.what)) {
    on_frame(*frame, now);
  } else if (const auto* detached = std::get_if<DetachedEvent>(&event.what)) {
    on_detached(*detached, now);
  } else if (std::holds_alternative<DrainedEvent>(event.what) && shards_to_drain_ > 0) {
    --shards_to_drain_;
  }
}

void Conductor::on_frame(const ControlFrameEvent& event, milliseconds now) {
  const Session* session = find(event.session, event.node);
  // What a replaced connection had asked would count as declared on the new one, by which the node never asks for it.
  if (session == nullptr || event.attachment != session->attachment || event.frame.size() < proto::kHeaderSize) return;
  const proto::Kind kind = proto::load_header(event.frame.data()).kind;
  const std::span<const std::byte> payload = std::span{event.frame}.subspan(proto::kHeaderSize);
  const auto view = proto::split_control(payload);
  if (!view) return close(*session, GoodbyeCode::malformed, "a control frame without operation and request number");
  if (kind != proto::Kind::ns && kind != proto::Kind::ctrl) {
    return close(*session, GoodbyeCode::not_allowed, "frames of that kind are between hubs only");
  }
  Effects effects;
  HandlerContext context{facts_,         limits_,          membership_,     watches_, wiring_.counters, now, effects,
                         wiring_.queues, wiring_.refusals, &name_counters_, this};
  const Request request{*session, view->header, payload};
  const NodeId dst{proto::load_header(event.frame.data()).dst};
  const bool is_ours = dst == NodeId{} || dst == make_id<NodeId>(facts_.id, kHubIndex);
  const Handler handle = is_ours ? handler_for(session->role, kind, view->header.operation) : handle_for_another;
  const ShardIndex shard = session->place.shard;
  const proto::Payload answer = handle(context, request);
  if (kind == proto::Kind::ns) name_counters_.count(view->header.operation, proto::peek_status(answer));
#ifndef GIMNET_BUG_ANSWER_BEFORE_TABLES
  carry_out(effects, now);
#endif
  SendControlCommand command;
  command.session = event.session;
#ifndef GIMNET_BUG_ANSWER_TO_ANY_CONNECTION
  command.attachment = event.attachment;
#endif
  command.frame = control_frame(kind, event.node, facts_.id, answer);
#ifdef GIMNET_BUG_ANSWER_NAMES_THE_SLOT
  command.frame = control_frame(kind, make_id<NodeId>(facts_.id, event.session.slot.value() + 1), facts_.id, answer);
#endif
  command.answers = 1;
  wiring_.shards.send(shard, std::move(command));
#ifdef GIMNET_BUG_ANSWER_BEFORE_TABLES
  carry_out(effects, now);
#endif
}

void Conductor::on_detached(const DetachedEvent& event, milliseconds now) {
  Session* session = find(event.session, event.node);
  // The end of a connection that a newer one has replaced says nothing about the session.
  if (session == nullptr || event.attachment != session->attachment || !session->connected) return;
  const bool said = event.said_by_peer || event.code != GoodbyeCode::done;
  std::string line = title(node_id(*session), *session);
  if (event.said_by_peer && event.code == GoodbyeCode::done) {
    line += " left";
  } else if (said) {
    line += std::string{event.said_by_peer ? " said goodbye: " : " was closed: "} + proto::goodbye_name(event.code) +
            (event.sentence.empty() ? "" : ": ") + event.sentence;
  } else {
    line += " lost its connection";
  }
  log_info(line);
  Effects effects;
  watches_.connection_ended(session->index);
  membership_.connection_ended(*session, {event.said_by_peer, event.code, event.sentence}, now, effects);
  carry_out(effects, now);
}

void Conductor::close(const Session& session, GoodbyeCode code, std::string sentence) {
  wiring_.shards.send(session.place.shard, CloseCommand{ref_of(session.place), code, std::move(sentence)});
}

void Conductor::tick(milliseconds now) {
  Effects effects;
  membership_.tick(now, effects);
  if (keep_again_at_ && *keep_again_at_ <= now) effects.emplace_back(StateDue{});
  carry_out(effects, now);
  if (returns_until_ && *returns_until_ <= now) {
    wiring_.tables.nodes.expect_returns_below(0);
    returns_until_.reset();
  }
  publisher_.collect();
}

std::optional<milliseconds> Conductor::next_deadline() const {
  std::optional<milliseconds> deadline = membership_.next_deadline();
  for (const std::optional<milliseconds>& other : {keep_again_at_, returns_until_}) {
    if (other && (!deadline || *other < *deadline)) deadline = other;
  }
  return deadline;
}

void Conductor::drain() {
  if (draining_) return;
  draining_ = true;
  shards_to_drain_ = facts_.shards;
  for (std::size_t i = 0; i < facts_.shards; ++i) {
    wiring_.shards.send(ShardIndex{static_cast<std::uint8_t>(i)}, DrainCommand{limits_.drain_ms});
  }
}

Reloading Conductor::reload() {
  Reloading reloading;
  if (wiring_.read_again) reloading = wiring_.read_again();
  if (!wiring_.read_again) reloading.faults.emplace_back("this hub has no configuration that could be read again");
  for (const std::string& fault : reloading.faults) log_error(fault);
  if (!reloading.faults.empty()) {
    log_error("the configuration was not read again: the former one stays in force, whole");
    return reloading;
  }
  limits_ = reloading.limits;
  for (std::size_t i = 0; i < facts_.shards; ++i) {
    wiring_.shards.send(ShardIndex{static_cast<std::uint8_t>(i)}, LimitsCommand{reloading.limits});
  }
  set_log_level(reloading.log_level);
  log_info(reload_summary(reloading));
  return reloading;
}

void Conductor::log_level_set(LogLevel level) {
  if (wiring_.note_log_level) wiring_.note_log_level(level);
}

Session* Conductor::find(const SessionRef& ref, NodeId node) {
  // The shard may have said it before it heard of a new id.
  Session* session = membership_.sessions().find(membership_.sessions().present_index(index_of(node)));
  if (session == nullptr || session->place.generation != ref.generation) return nullptr;
  return session;
}

NodeId Conductor::node_id(const Session& session) const { return membership_.sessions().node_id(session); }

void Conductor::carry_out(const Effects& effects, milliseconds now) {
  // First what has to outlive a crash, and once for all of them: what follows is seen by others.
  for (const Effect& effect : effects) {
    if (!std::holds_alternative<StateDue>(effect)) continue;
    keep_state(now);
    break;
  }
  for (const Effect& effect : effects) {
    std::visit(
        [&](const auto& one) {
          using One = std::remove_cvref_t<decltype(one)>;
          if constexpr (std::is_same_v<One, NodeNoted> || std::is_same_v<One, ServiceNoted>) {
            watches_.note(one, membership_, now);
          } else {
            carry_out_one(one);
          }
        },
        effect);
  }
}

void Conductor::carry_out_one(const StateDue&) {}  // carry_out() has seen to it

void Conductor::keep_state(milliseconds now) {
  if (!wiring_.keep_state || (keep_again_at_ && *keep_again_at_ > now)) return;
  const Durable durable = membership_.durable();
  HubState state = state_;
  state.node_mark = durable.node_mark;
  state.group_mark = durable.group_mark;
  state.kicked = durable.kicked;
  if (const std::string error = wiring_.keep_state(state); !error.empty()) {
    log_error(error + "; the hub goes on, but soon gives no ids to newcomers, and forgets at a restart whom it kicked");
    keep_again_at_ = now + kKeepAgainAfter;
    return;
  }
  keep_again_at_.reset();
  state_ = std::move(state);
  membership_.state_kept(durable);
}

void Conductor::carry_out_one(const CloseDue& effect) {
  wiring_.shards.send(effect.place.shard, CloseCommand{ref_of(effect.place), effect.code, effect.sentence});
}

void Conductor::carry_out_one(const NodeChanged& effect) { publisher_.publish_node(effect.index, membership_); }

void Conductor::carry_out_one(const GroupChanged& effect) { publisher_.publish_group(effect.index, membership_); }

void Conductor::carry_out_one(const SessionEnded& effect) {
  wiring_.shards.send(effect.place.shard, ReleaseCommand{ref_of(effect.place)});
}

void Conductor::carry_out_one(const RenumberDue& effect) {
  watches_.connection_ended(effect.former);
  wiring_.shards.send(effect.place.shard,
                      RenumberCommand{ref_of(effect.place), make_id<NodeId>(facts_.id, effect.index), effect.sentence});
}

void Conductor::carry_out_one(const ServiceMovedDue& effect) {
  const Session* session = membership_.sessions().find(effect.subscriber);
  if (session == nullptr) return;
  ns::ServiceMoved event;
  event.name = effect.full_name;
  event.old_group = effect.old_group == 0 ? GroupId{} : make_id<GroupId>(facts_.id, effect.old_group);
  event.new_group = effect.new_group == 0 ? GroupId{} : make_id<GroupId>(facts_.id, effect.new_group);
  event.message_type = effect.message_type;
  event.instance = effect.instance;
  event.delivery = static_cast<ns::Delivery>(effect.delivery);
  event.window = effect.window;
  event.retain = effect.retain;
  send_event(*session, proto::encode(event));
}

void Conductor::carry_out_one(const PaceDue& effect) {
  const Session* session = membership_.sessions().find(effect.subscriber);
  if (session == nullptr) return;
  const PaceTerms terms{effect.terms.window, effect.terms.depth, effect.terms.interval_us};
  wiring_.shards.send(
      session->place.shard,
      PaceCommand{ref_of(session->place), make_id<GroupId>(facts_.id, effect.group), terms, effect.retained});
}

void Conductor::carry_out_one(const PaceEnded& effect) {
  const Session* session = membership_.sessions().find(effect.subscriber);
  if (session == nullptr) return;  // its subscriptions end with it
  wiring_.shards.send(
      session->place.shard,
      EndPaceCommand{ref_of(session->place), make_id<GroupId>(facts_.id, effect.group), effect.group_gone});
}

void Conductor::carry_out_one(const RetainedDropped& effect) {
  const Session* session = membership_.sessions().find(effect.provider);
  if (session == nullptr) return;  // what its shard keeps of it ends with it
  wiring_.shards.send(session->place.shard, ForgetRetainedCommand{make_id<GroupId>(facts_.id, effect.group)});
}

void Conductor::carry_out_one(const SubscriberDue& effect) {
  const Session* session = membership_.sessions().find(effect.provider);
  if (session == nullptr) return;
  const auto fill = [&](auto event) {
    event.group = make_id<GroupId>(facts_.id, effect.group);
    event.node = make_id<NodeId>(facts_.id, effect.subscriber);
    event.subscribers = effect.subscribers_now;
    return proto::encode(event);
  };
  send_event(*session, effect.joined ? fill(ns::SubscriberJoined{}) : fill(ns::SubscriberLeft{}));
}

void Conductor::carry_out_one(const NameDecided& effect) {
  const Session* session = membership_.sessions().find(effect.node);
  if (session == nullptr) return;
  send_event(*session, effect.confirmed ? proto::encode(ns::NameConfirmed{effect.name})
                                        : proto::encode(ns::NameLost{effect.name, effect.holder, effect.sentence}));
}

bool Conductor::serve_watches(milliseconds now) {
  const std::uint64_t resyncs = watches_.resyncs();
  const bool more = watches_.serve(membership_, now, [this](std::uint32_t node, const proto::Payload& events) {
    const Session* session = membership_.sessions().find(node);
    if (session != nullptr) send_event(*session, events);
  });
  name_counters_.resyncs.add(watches_.resyncs() - resyncs);
  return more;
}

void Conductor::send_event(const Session& session, const proto::Payload& payload) {
  if (!session.connected) return;  // it declares again when it is back, and learns what is true then
  auto frame = control_frame(proto::Kind::ns, node_id(session), facts_.id, payload);
  wiring_.shards.send(session.place.shard,
                      SendControlCommand{.session = ref_of(session.place), .frame = std::move(frame)});
}

}  // namespace gimnet::hub
