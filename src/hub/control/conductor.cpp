#include "hub/control/conductor.hpp"

#include "base/check.hpp"
#include "base/ids.hpp"
#include "base/log.hpp"
#include "hub/control/dispatch.hpp"
#include "hub/control/log_peer.hpp"
#include "hub/shard/control_frame.hpp"
#include "proto/control/ns_register.hpp"
#include "proto/control/ns_watch.hpp"
#include "proto/frame/frame_parser.hpp"

namespace gimnet::hub {
namespace {

using proto::Goodbye;
using proto::GoodbyeCode;
using std::chrono::milliseconds;

/// Was the request of no use to anybody?
bool is_odd(proto::Status status) {
  if (status == proto::Status::denied) return true;
  return status == proto::Status::bad_request || status == proto::Status::not_supported;
}

/// The log's subject: nobody who comes and goes again and again fills the log, nor keeps others out
/// of it.
LogSubject subject(std::string_view reason, const Session& session) {
  if (!session.name.empty()) return {reason, session.name};
  return {reason, log_peer(session.origin.transport, session.origin.address)};
}

Sessions::Options sessions_options(const HubFacts& facts, Placement placement, const Limits& limits,
                                   const HubStart& start) {
  Sessions::Options options;
  options.hub = facts.id;
  options.shards = facts.shards;
  options.placement = placement;
  options.secret = start.state.secret;
  options.boot = start.state.boot;
  options.nodes = start.nodes;
  options.groups = start.groups;
  options.kicked = start.state.kicked;
  if (start.state.boot > 1) options.returns_until = facts.started + milliseconds{limits.grace_ms};
  return options;
}

}  // namespace

Conductor::Conductor(HubFacts facts, Placement placement, Limits& limits, Wiring wiring)
    : facts_(std::move(facts)),
      limits_(limits),
      wiring_(std::move(wiring)),
      membership_(sessions_options(facts_, placement, limits, wiring_.start), limits),
      watches_(HubTitle{facts_.id, facts_.name}, epoch_of(wiring_.start), limits),
      publisher_(facts_.id, facts_.shards, wiring_.tables),
      keeper_(wiring_.start.state, wiring_.keep_state),
      names_({facts_, limits_, membership_, watches_}),
      groups_({facts_, limits_, wiring_.shards, membership_, publisher_, names_}),
      runner_({facts_, limits_, wiring_.shards, membership_, watches_, publisher_, keeper_, &names_,
               &groups_}),
      returns_published_(membership_.sessions().returns_until().has_value()) {
  GIMNET_CHECK(wiring_.shards.shards() == facts_.shards);
  if (wiring_.network) {
    links_ = std::make_unique<Links>(
        wiring_.network->options,
        Links::Wiring{facts_, limits_, wiring_.shards, membership_.sessions().slots(),
                      wiring_.network->routes, names_, groups_, wiring_.network->dial,
                      wiring_.network->random});
    overview_ = std::make_unique<NetworkOverview>(
        NetworkOverview::Parts{facts_, *links_, names_, groups_, wiring_.sessions});
    remote_requests_ =
        std::make_unique<RemoteRequests>(RemoteRequests::Parts{facts_, wiring_.shards, *links_});
    moving_ = std::make_unique<MovingNodes>(
        MovingNodes::Parts{facts_, limits_, *links_, names_, wiring_.refusals});
  }
  if (returns_published_) publisher_.expect_all(wiring_.start.nodes.used);
}

std::optional<Goodbye> Conductor::admit(Stranger& stranger, const proto::Hello& hello,
                                        Moment moment) {
  if (hello.role == proto::Role::hub && links_ != nullptr && !draining_)
    return links_->admit(stranger, hello, {moment.now, moment.wall_ns});
  if (moving_ != nullptr && !draining_ && moving_->take(stranger, hello, moment.now))
    return std::nullopt;
  return admit_node(stranger, hello, moment, false);
}

std::optional<Goodbye> Conductor::admit_node(Stranger& stranger, const proto::Hello& hello,
                                             Moment moment, bool had_name) {
  if (draining_)
    return Goodbye{GoodbyeCode::draining, "the hub is shutting down; connect to another one"};
  Effects effects;
  const milliseconds wall{moment.wall_ns / 1'000'000};
  const auto joined =
      membership_.join(join_request_of(stranger, hello, wall, had_name), moment.now, effects);
  carry_out(effects, moment.now);
  if (!joined) return joined.error();
  attach(stranger, hello, *joined, moment);
  return std::nullopt;
}

void Conductor::attach(Stranger& stranger, const proto::Hello& hello,
                       const Membership::Joined& joined, Moment moment) {
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
  const auto seen = std::exchange(session.change_seen, membership_.topics().changes());
  runner_.tellings().add_moved(session, seen, command.told);
  // Before the command, which lets WELCOME out: who has seen that can be reached. The id is
  // nobody's before.
  publisher_.publish_node(session.index, membership_);
  wiring_.shards.send(session.place.shard, std::move(command));
  runner_.tellings().join_moved(session, seen);
  session.closing.reset();
  session.renumbered = false;
  log_line(LogLevel::info, subject("joined", session),
           title(node_id(session), session) +
               (session.came_back ? " came back over " : " joined over ") +
               session.origin.transport.str() + " from " + session.origin.address.str() +
               ", shard " + std::to_string(session.place.shard.value()));
}

proto::Welcome Conductor::welcome(const Session& session, const proto::Hello& hello,
                                  Moment moment) const {
  proto::Welcome welcome;
  welcome.node = node_id(session);
  welcome.token = membership_.sessions().token_of(session);
  welcome.hub = facts_.id;
  welcome.hub_name = facts_.name;
  welcome.frame_length_max = static_cast<std::uint32_t>(limits_.frame_bytes);
  welcome.features = proto::kFeatureMissed;
  welcome.keep_alive_ms = static_cast<std::uint32_t>(limits_.keep_alive_ms);
  welcome.silent_ms = static_cast<std::uint32_t>(limits_.silent_ms);
  welcome.hub_time_ns = moment.wall_ns;
  welcome.resume_buffer_bytes = hello.resume ? static_cast<std::uint32_t>(limits_.resume_bytes) : 0;
  welcome.grace_ms = static_cast<std::uint32_t>(limits_.grace_ms);
  welcome.name = session.name.str();
  welcome.retained_bytes_max = static_cast<std::uint32_t>(limits_.retained_most());
  if (session.closing) {
    welcome.last_goodbye_code = static_cast<std::uint16_t>(session.closing->code);
    welcome.last_goodbye_sentence = session.closing->sentence.substr(0, proto::kSentenceBytesMax);
  }
  return welcome;
}

void Conductor::on_event(ShardEvent event, milliseconds now) {
  const auto is_link = [this](NodeId id) { return links_ != nullptr && index_of(id) == kHubIndex; };
  if (const auto* frame = std::get_if<ControlFrameEvent>(&event.what)) {
    is_link(frame->node) ? on_link_frame(*frame, now) : on_frame(*frame, now);
  } else if (const auto* detached = std::get_if<DetachedEvent>(&event.what)) {
    if (!is_link(detached->node)) return on_detached(*detached, now);
    links_->on_detached(*detached, moment(now));
    settle(now);
    admit_moved({}, now);
  } else if (const auto* released = std::get_if<ReleasedEvent>(&event.what)) {
    if (links_ != nullptr) links_->on_released(*released);
  } else if (const auto* missed = std::get_if<EventsMissedEvent>(&event.what)) {
    if (const Session* session = find(missed->session, missed->node))
      runner_.events_missed(*session, missed->attachment);
  } else if (const auto* told = std::get_if<MissedEvent>(&event.what)) {
    membership_.services().note_missed(node_index_of(told->node), told->missed);
  } else if (std::holds_alternative<DrainedEvent>(event.what) && shards_to_drain_ > 0) {
    --shards_to_drain_;
  }
}

void Conductor::on_frame(const ControlFrameEvent& event, milliseconds now) {
  const Session* session = find(event.session, event.node);
  // Requests of a replaced connection are not answered: they would count as declared on the new
  // one, where the node has not asked for them.
  if (session == nullptr || event.attachment != session->attachment ||
      event.frame.size() < proto::kHeaderSize)
    return;
  const proto::FrameHeader header = proto::load_header(event.frame.data());
  const proto::Kind kind = header.kind;
  std::span<const std::byte> payload = std::span{event.frame}.subspan(proto::kHeaderSize);
  if (header.has(proto::kFlagExt)) {
    const auto frame = proto::parse_frame(event.frame, proto::Origin::node);
    if (!frame)
      return close(*session, GoodbyeCode::malformed, proto::frame_error_text(frame.error()));
    payload = frame->payload;
  }
  const auto view = proto::split_control(payload);
  if (!view)
    return close(*session, GoodbyeCode::malformed,
                 "a control frame without operation and request number");
  // The shards let no ROUTE through (check_header_from_node()): a hole there is not to reach a
  // handler.
  if (kind != proto::Kind::ns && kind != proto::Kind::ctrl) {
    return close(*session, GoodbyeCode::not_allowed, "frames of that kind are between hubs only");
  }
  Effects effects;
  HandlerContext context = context_for(effects, now);
  const bool names_us = NodeId{header.dst} == make_id<NodeId>(facts_.id, kHubIndex);
  const bool is_ours = header.dst == 0 || names_us;
  const Request request{*session, view->header, payload, names_us};
  const ShardIndex shard = session->place.shard;
  std::optional<proto::Refusal> refusal;
  if (!is_ours && remote_requests_ != nullptr) {
    refusal = remote_requests_->send_on(event, shard, now);
    if (!refusal) return;
  }
  const Handler handle =
      is_ours ? handler_for(session->role, kind, view->header.operation) : handle_for_another;
  const proto::Payload answer =
      refusal ? proto::encode_refusal(view->header, *refusal) : handle(context, request);
  const proto::Status status = proto::peek_status(answer);
  request_counters_.count(kind, view->header.operation, status);
  carry_out(effects, now);
  SendControlCommand command;
  command.session = event.session;
  command.attachment = event.attachment;
  command.frame = control_frame(kind, event.node, facts_.id, answer);
  command.answers = 1;
  command.counts = context.counts;
  if (context.joins && groups_.hold(*context.joins, shard, command, now)) return;
  wiring_.shards.send(shard, std::move(command));
  if (is_odd(status)) on_oddity(event, now);
}

HandlerContext Conductor::context_for(Effects& effects, milliseconds now) {
  HandlerContext context{facts_, limits_, membership_,      watches_,         wiring_.counters,
                         now,    effects, wiring_.sessions, wiring_.refusals, &request_counters_,
                         this};
  context.network = overview_.get();
  context.names = &names_;
  context.wall = milliseconds{moment(now).wall_ns / 1'000'000};
  return context;
}

void Conductor::on_link_frame(const ControlFrameEvent& event, milliseconds now) {
  const proto::FrameHeader header = proto::load_header(event.frame.data());
  if (event.frame.size() == proto::kHeaderSize) return log_refused(event.node, header);
  const proto::Kind kind = header.kind;
  const std::span<const std::byte> payload = std::span{event.frame}.subspan(proto::kHeaderSize);
  if (kind == proto::Kind::route) {
    links_->on_route(event.session, event.attachment, payload, moment(now));
    return settle(now);
  }
  if (!remote_requests_->take(event, now))
    return admit_moved(remote_requests_->take_own_answers(), now);
  const auto view = proto::split_control(payload);
  if (!view) return;
  Effects effects;
  HandlerContext context = context_for(effects, now);
  static const Session kAfar{};
  const Handler handle = handler_from_afar(NodeId{header.src}, kind, view->header.operation);
  const proto::Payload answer = handle(context, {kAfar, view->header, payload, true});
  carry_out(effects, now);
  remote_requests_->answer(event, answer);
}

void Conductor::admit_moved(std::span<const HubAnswer> answers, milliseconds now) {
  moving_->settle(answers, now, [&](Stranger& stranger, const proto::Hello& hello, bool had_name) {
    return admit_node(stranger, hello, {now, moment(now).wall_ns}, had_name);
  });
}

void Conductor::on_oddity(const ControlFrameEvent& event, milliseconds now) {
  Session* session = find(event.session, event.node);
  if (session == nullptr ||
      session->oddities.take({limits_.oddities_per_s, limits_.oddities_burst}, now))
    return;
  close(*session, GoodbyeCode::oddities,
        "more than " + std::to_string(limits_.oddities_burst) +
            " requests were answered bad_request, not_supported or denied in a short time; look at "
            "the answers");
}

void Conductor::on_detached(const DetachedEvent& event, milliseconds now) {
  Session* session = find(event.session, event.node);
  // The end of a connection that a newer one has replaced says nothing about the session.
  if (session == nullptr || event.attachment != session->attachment || !session->connected) return;
  std::string line = title(node_id(*session), *session);
  if (event.said_by_peer && event.code == GoodbyeCode::done) {
    line += " left";
  } else if (event.said_by_peer || event.code != GoodbyeCode::done) {
    line += std::string{event.said_by_peer ? " said goodbye: " : " was closed: "} +
            proto::goodbye_name(event.code) + (event.sentence.empty() ? "" : ": ") + event.sentence;
  } else {
    line += " lost its connection";
  }
  log_line(LogLevel::info, subject("left", *session), line);
  Effects effects;
  watches_.connection_ended(session->index);
  membership_.connection_ended(*session, {event.said_by_peer, event.code, event.sentence}, now,
                               effects);
  carry_out(effects, now);
}

void Conductor::close(const Session& session, GoodbyeCode code, std::string sentence) {
  wiring_.shards.send(session.place.shard,
                      CloseCommand{ref_of(session.place), code, std::move(sentence)});
}

void Conductor::tick(milliseconds now) {
  if (links_ != nullptr) {
    links_->tick(moment(now));
    settle(now);
    remote_requests_->tick(now);
    admit_moved({}, now);
  }
  Effects effects;
  membership_.tick(now, effects);
  if (keeper_.again_at() && *keeper_.again_at() <= now) effects.emplace_back(StateDue{});
  if (returns_published_ && membership_.sessions().returns_expected_for(now) <= milliseconds{0}) {
    // Indices of nodes that did not come back after the restart are free.
    if (membership_.keeping_due(now)) effects.emplace_back(StateDue{});
    wiring_.tables.nodes.expect_nobody();
    returns_published_ = false;
  }
  carry_out(effects, now);
  publisher_.collect();
}

std::optional<milliseconds> Conductor::next_deadline() const {
  std::optional<milliseconds> deadline = membership_.next_deadline();
  const auto returns_until =
      returns_published_ ? membership_.sessions().returns_until() : std::nullopt;
  const auto links_due = links_ != nullptr ? links_->next_deadline() : std::nullopt;
  const auto answers_due = links_ != nullptr ? remote_requests_->next_due() : std::nullopt;
  const auto moving_due = links_ != nullptr ? moving_->next_due() : std::nullopt;
  for (const std::optional<milliseconds>& other : {keeper_.again_at(), returns_until, links_due,
                                                   answers_due, moving_due, groups_.next_due()}) {
    if (other && (!deadline || *other < *deadline)) deadline = other;
  }
  return deadline;
}

void Conductor::drain() {
  if (draining_) return;
  draining_ = true;
  if (links_ != nullptr) links_->drain();
  shards_to_drain_ = facts_.shards;
  for (std::size_t i = 0; i < shards_to_drain_; ++i) {
    wiring_.shards.send(ShardIndex{static_cast<std::uint8_t>(i)}, DrainCommand{limits_.drain_ms});
  }
}

Reloading Conductor::reload() {
  Reloading reloading;
  if (wiring_.read_again) reloading = wiring_.read_again();
  if (!wiring_.read_again)
    reloading.faults.emplace_back("this hub has no configuration that could be read again");
  if (!reloading.faults.empty()) {
    log_faults(reloading);
    return reloading;
  }
  limits_ = reloading.limits;
  set_log_rates({limits_.log_lines_per_s, limits_.peer_log_lines_per_s});
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
  Session* session =
      membership_.sessions().find(membership_.sessions().present_index(node_index_of(node)));
  if (session == nullptr || session->place.generation != ref.generation) return nullptr;
  return session;
}

NodeId Conductor::node_id(const Session& session) const {
  return membership_.sessions().node_id(session);
}

bool Conductor::tell_rest(milliseconds now) {
  const bool more_services = runner_.tell_rest();
  const std::uint64_t resyncs = watches_.resyncs();
  const bool more_watched =
      watches_.serve(membership_, now, [this](NodeIndex node, const proto::Payload& events) {
        const Session* session = membership_.sessions().find(node);
        if (session != nullptr) runner_.send_event(*session, events);
      });
  request_counters_.resyncs.add(watches_.resyncs() - resyncs);
  return more_services || more_watched;
}

}  // namespace gimnet::hub
