#include "client/nif/node.hpp"

#include <algorithm>
#include <array>
#include <cstring>
#include <system_error>
#include <utility>

#include "base/random.hpp"
#include "base/signals_blocked.hpp"
#include "proto/frame/frame_builder.hpp"

// A node as the program's threads see it, and what the receiving half asks of it; its thread is in
// node_thread.cpp.

namespace gimnet::nif {
namespace {

/// Between two tries of nif_connect() with wait_for_hub.
Deadline try_again_at(net::DialBackoff& backoff, Deadline deadline) {
  return std::min(deadline, steady_now_ns() + backoff.next_ns(random_bits()));
}

void copy_text(char* to, std::size_t size, const std::string& text) {
  const std::size_t length = std::min(text.size(), size - 1);
  std::memcpy(to, text.data(), length);
  to[length] = '\0';
}

/// Worth another try while the hub may still be starting.
bool may_come(nif_status status) {
  return status == NIF_NO_HUB || status == NIF_NO_HOST || status == NIF_HUB_FULL ||
         status == NIF_REFUSED;
}

}  // namespace

Node::Node(Options options)
    : options_(std::move(options)),
      outbound_(options_.send, wake_, options_.last_message_bytes),
      received_(options_.receive_queue_bytes, wake_),
      requests_(outbound_),
      credits_(outbound_),
      declarations_(requests_, outbound_, credits_),
      watches_(requests_),
      inbound_(options_.reassembly, *this),
      tokens_(options_.name, options_.keep_token),
      name_(options_.name),
      addresses_(options_.addresses),
      epoch_(random_bits() | 1) {}

Node::~Node() = default;

proto::Hello Node::hello() const {
  proto::Hello hello;
  hello.role = options_.administrator ? proto::Role::admin : proto::Role::node;
  hello.name = name_;
  hello.description = options_.description;
  hello.token = session_.token;
  hello.epoch = epoch_;
  hello.resume = options_.resume;
  hello.resume_epoch = session_.resume ? session_.hub_epoch : 0;
  hello.resume_taken = session_.resume ? inbound_.taken() : 0;
  hello.former = NodeId{session_.id};
  hello.shard = options_.shard;
  hello.resume_buffer_bytes =
      static_cast<std::uint32_t>(std::min<std::size_t>(options_.send.retained_bytes, UINT32_MAX));
  return hello;
}

Result<std::unique_ptr<Node>, Failure> Node::connect(Options options) {
  std::unique_ptr<Node> node(new Node(std::move(options)));
  if (!node->wake_.valid() || !node->stop_.valid()) {
    return Failure{NIF_NO_MEMORY, "cannot connect: this process has no descriptors left"};
  }
  const Deadline deadline = deadline_after(node->options_.connect_timeout_ms);
  net::DialBackoff backoff;
  const auto token_for = [&node](const std::string& address) {
    return node->tokens_.find(address);
  };
  for (;;) {
    auto admitted = admit(node->addresses_, node->options_.dialling, node->hello(), deadline,
                          node->stop_, token_for);
    if (admitted) {
      if (!node->take_over(std::move(*admitted), true)) {
        return Failure{NIF_PROTOCOL, "the hub resumes a connection that never was"};
      }
      break;
    }
    const bool again = node->options_.wait_for_hub && may_come(admitted.error().status);
    if (!again || steady_now_ns() >= deadline) return admitted.error();
    static_cast<void>(net::wait_for(nullptr, {}, node->stop_, try_again_at(backoff, deadline)));
  }
  try {
    const SignalsBlocked blocked;
    node->thread_ = std::thread([raw = node.get()] { raw->run(); });
  } catch (const std::system_error&) {
    return Failure{NIF_NO_MEMORY, "cannot connect: the system has no thread left"};
  }
  return node;
}

bool Node::take_over(Admitted admitted, bool first) {
  stream_ = std::move(admitted.stream);
  const bool same_id = admitted.session.id == session_.id;
  session_ = std::move(admitted.session);
  if (!first) outbound_.begin_declaring();  // until declare_again() below knows better
  // Before anything can be posted: a total of the earlier connection would count as one of this.
  credits_.begin(session_);
  const auto let_go = outbound_.attach(*stream_, session_);
  if (!let_go) return false;
  id_.store(session_.id, std::memory_order_relaxed);  // a number by itself
  last_heard_ns_ = last_tick_ns_ = steady_now_ns();
  last_ping_ns_ = 0;
  if (session_.hub_time_ns != 0) clock_.begin(session_.hub_time_ns, last_heard_ns_);
  address_ = std::move(admitted.address);
  hub_ends_ = false;
  const auto there = std::ranges::find(addresses_, address_, &net::Address::url);
  if (there != addresses_.end()) std::rotate(addresses_.begin(), there, addresses_.end());
  keep_token();
  {
    const MutexLock lock(mutex_);
    info_.id = session_.id;
    info_.hub_id = session_.hub_id;
    info_.connected = 1;
    info_.resume = session_.resume ? 1 : 0;
    info_.reconnects += first ? 0 : 1;
    info_.frame_bytes_max = session_.frame_bytes_max;
    copy_text(info_.name, sizeof info_.name, session_.name);
    copy_text(info_.hub_name, sizeof info_.hub_name, session_.hub_name);
    if (!session_.earlier_goodbye.empty())
      last_error_ = "the hub ended this node's last connection: " + session_.earlier_goodbye;
  }
  if (!first) {
    Record* event = make_event(NIF_CONNECTED, session_.earlier_goodbye);
    event->incoming.from = session_.id;
    event->incoming.flags = static_cast<std::uint8_t>(
        (session_.resumed ? NIF_CONNECTED_RESUMED : 0) | (same_id ? NIF_CONNECTED_SAME_ID : 0));
    push_event(event);
  }
  if (*let_go > 0) {
    Record* gap = make_event(NIF_GAP, proto::drop_reason_name(proto::DropReason::link_lost));
    gap->incoming.from = session_.id;
    gap->incoming.count = *let_go;
    gap->incoming.reason = static_cast<std::uint32_t>(proto::DropReason::link_lost);
    push_event(gap);
  }
  credits_.tell_all();
  inbound_.begin(session_);
  confirmed_ = inbound_.taken();
  if (!first) {
    declarations_.declare_again({!session_.resumed, !session_.resumed || *let_go > 0});
    received_.push(declarations_.take_events());
    watches_.declare_again();
  }
  return true;
}

void Node::keep_token() {
  tokens_.keep(address_, session_.token);
  const MutexLock lock(mutex_);
  info_.token_kept = tokens_.kept() ? 1 : 0;
  if (!tokens_.fault().empty()) last_error_ = tokens_.fault();
}

void Node::push_event(Record* record) {
  record->incoming.arrival_ns = wall_now_ns();
  const Item item = item_of(record, record->text.size());
  received_.push(std::span(&item, 1));
}

void Node::deliver(std::span<const Item> items) { received_.push(items); }

bool Node::on_flow(const proto::flow::Message& message) {
  if (const auto* ping = std::get_if<proto::flow::Ping>(&message)) {
    outbound_.post(proto::flow::Pong{ping->sequence, ping->sent_ns, wall_now_ns()});
    confirm();
  } else if (const auto* pong = std::get_if<proto::flow::Pong>(&message)) {
    clock_.on_pong(*pong, steady_now_ns());
  } else if (const auto* pause = std::get_if<proto::flow::Pause>(&message)) {
    outbound_.on_pause(pause->target);
  } else if (const auto* resume = std::get_if<proto::flow::Resume>(&message)) {
    outbound_.on_resume(resume->target);
    if (resume->target.kind == proto::Kind::taken)
      inbound_.tell_taken_again(NodeId{resume->target.dst});
  } else if (const auto* confirmed = std::get_if<proto::flow::Confirm>(&message)) {
    return outbound_.on_confirm(confirmed->count);
  }
  return true;
}

std::vector<Item> Node::on_answer(proto::Kind kind, const proto::ControlView& answer) {
  if (kind == proto::Kind::ns &&
      answer.header.operation == proto::ns::SubscribeAnswer::kOperation) {
    // Before the first message behind it, which the program may take before it has seen this
    // answer.
    proto::Payload payload(proto::kControlHeaderSize);
    store_le(payload.data(), answer.header.operation);
    payload.insert(payload.end(), answer.body.begin(), answer.body.end());
    const auto subscribed = proto::decode_answer<proto::ns::SubscribeAnswer>(payload);
    if (subscribed) {
      credits_.open(subscribed->group, subscribed->window, subscribed->number);
      declarations_.on_subscribe_answer(subscribed->group);
    }
  }
  static_cast<void>(requests_.on_answer(kind, answer));
  std::vector<Item> events = declarations_.take_events();
  const std::vector<Item> ended_watches = watches_.take_events();
  events.insert(events.end(), ended_watches.begin(), ended_watches.end());
  return events;
}

bool Node::on_service_moved(const proto::ns::ServiceMoved& event) {
  return declarations_.on_service_moved(event);
}

bool Node::on_watch_events(const proto::ns::WatchEvents& events) {
  return watches_.on_events(events);
}

void Node::set_name(const std::string& name, std::vector<std::byte> token) {
  {
    const MutexLock lock(mutex_);
    copy_text(info_.name, sizeof info_.name, name);
    info_.token_kept = 0;
    new_name_ = NewName{name, std::move(token)};
  }
  wake_.raise();
}

void Node::take_new_name() {
  {
    const MutexLock lock(mutex_);
    if (!new_name_) return;
    name_ = std::move(new_name_->name);
    session_.token = std::move(new_name_->token);
    new_name_.reset();
  }
  // The token is for the new name: a program that is started again under the former one could not
  // use it.
  tokens_.rename(name_);
  keep_token();
  declarations_.declare_again({});  // services have other groups then, which tells
}

void Node::on_taken(std::uint32_t from, const proto::Taken& taken) {
  if (const auto report = outbound_.on_taken(from, taken)) push_event(make_report(*report, from));
}

bool Node::on_report(const proto::Report& report) {
  if (report.reason == proto::DropReason::no_such_node ||
      report.reason == proto::DropReason::renumbered) {
    names_.forget(report.header.dst);
  }
  return outbound_.on_report(report);
}

std::optional<ReportedMessages::Start> Node::message_of(const proto::Report& report) {
  return outbound_.message_of(report);
}

void Node::send_taken(std::uint32_t to, const proto::Taken& taken) {
  std::array<std::byte, proto::kTakenSize> payload;
  proto::encode_taken(taken, payload);
  proto::FrameParts parts;
  parts.header.kind = proto::Kind::taken;
  parts.header.dst = to;
  parts.header.lane = static_cast<std::uint8_t>(proto::Lane::real_time);
  std::array<std::byte, proto::kHeaderSize + proto::kTakenSize> frame;
  static_cast<void>(proto::write_frame(parts, payload, frame));
  outbound_.post_data(frame);
}

void Node::set_last_error(std::string sentence) {
  const MutexLock lock(mutex_);
  last_error_ = std::move(sentence);
}

std::string Node::last_error() {
  const MutexLock lock(mutex_);
  return last_error_;
}

std::uint32_t Node::reconnects() {
  const MutexLock lock(mutex_);
  return info_.reconnects;
}

nif_info Node::info() {
  const auto best = clock_.best();
  const MutexLock lock(mutex_);
  nif_info whole = info_;
  whole.keep_alive_seen = best ? 1 : 0;
  whole.round_trip_ns = best ? best->round_trip_ns : 0;
  whole.clock_offset_ns = best ? best->offset_ns : 0;
  return whole;
}

nif_counters Node::counters() {
  nif_counters whole{};
  outbound_.add_counters(whole);
  whole.receive_queue_bytes = received_.bytes();
  whole.read_stops = received_.stops();
  {
    const MutexLock lock(mutex_);
    whole.frames_received = inbound_counts_.frames;
    whole.messages_received = inbound_counts_.messages;
    whole.messages_lost = inbound_counts_.messages_lost;
    whole.gaps = inbound_counts_.gaps;
    whole.frames_ignored = inbound_counts_.ignored;
    whole.frames_unreadable = inbound_counts_.unreadable;
    whole.bytes_received = bytes_received_;
    whole.read_calls = read_calls_;
  }
  return whole;
}

nif_status Node::send(const nif_outgoing& message, std::int32_t timeout_ms) {
  Outgoing outgoing;
  if (const auto failure = outgoing.read(message, &clock_)) return fail(*failure);
  const bool may_wait = timeout_ms != 0 && !in_callback();
  return outbound_.send(outgoing, may_wait ? deadline_after(timeout_ms) : 0);
}

nif_status Node::ping_hub(HubClock::Measurement& measured, Deadline deadline) {
  const nif_status status = outbound_.wait_connected(deadline);
  if (status != NIF_OK) return status;
  const proto::flow::Ping ping = clock_.ping(steady_now_ns(), wall_now_ns());
  if (!outbound_.post(ping))
    return fail(NIF_NOT_CONNECTED, "the connection broke while the hub was pinged");
  const auto answer = clock_.wait_for(ping.sequence, deadline);
  if (answer) {
    measured = *answer;
    return NIF_OK;
  }
  if (closing_.load()) return fail(NIF_CLOSED, "the handle was closed");
  if (deadline != kNever && steady_now_ns() >= deadline)
    return fail(NIF_TIMEOUT, "the hub did not answer in time");
  return fail(NIF_NOT_CONNECTED, "the connection broke while the hub was pinged");
}

void Node::deliver_again() {
  deliver_calls_.fetch_add(1);
  wake_.raise();
}

void Node::begin_close() {
  closing_.store(true);
  outbound_.end({NIF_CLOSED, "the handle was closed"});
  received_.close();
  requests_.close();
  clock_.clear();
}

void Node::close() {
  stop_.raise();
  wake_.raise();
  if (thread_.joinable()) thread_.join();
}

void Node::abandon() { stream_.reset(); }

}  // namespace gimnet::nif
