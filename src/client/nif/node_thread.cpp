#include "client/nif/node_thread.hpp"

#include <algorithm>
#include <new>
#include <system_error>
#include <utility>

#include "base/random.hpp"
#include "base/signals_blocked.hpp"
#include "net/dial_handshake.hpp"

namespace gimnet::nif {
namespace {

/// nif_close() goes on this long to write what waits.
constexpr std::int64_t kLeaveNs = 1'000'000'000;

thread_local constinit const NodeThread* t_current = nullptr;

/// Worth another try while the hub may still be starting.
bool may_come(nif_status status) {
  return status == NIF_NO_HUB || status == NIF_NO_HOST || status == NIF_HUB_FULL ||
         status == NIF_REFUSED;
}

}  // namespace

NodeThread::NodeThread(NodeParts& parts, InboundHost& host)
    : parts_(parts),
      inbound_(parts.options.reassembly, host),
      tokens_(parts.options.name, parts.options.keep_token),
      plan_(parts.options),
      delivery_(parts.options, parts.received, parts.outbound, parts.credits, parts.closing),
      name_(parts.options.name),
      epoch_(random_bits() | 1) {}

proto::Hello NodeThread::hello() const {
  const Options& options = parts_.options;
  proto::Hello hello;
  hello.role = options.administrator ? proto::Role::admin : proto::Role::node;
  hello.name = name_;
  hello.description = options.description;
  hello.token = session_.token;
  hello.epoch = epoch_;
  hello.resume = options.resume;
  hello.resume_epoch = session_.resume ? session_.hub_epoch : 0;
  hello.resume_taken = session_.resume ? inbound_.taken() : 0;
  hello.former = NodeId{session_.id};
  hello.shard = options.shard;
  hello.resume_buffer_bytes =
      static_cast<std::uint32_t>(std::min<std::size_t>(options.send.retained_bytes, UINT32_MAX));
  return hello;
}

std::optional<Failure> NodeThread::start() {
  if (!parts_.wake.valid() || !parts_.stop.valid())
    return Failure{NIF_NO_MEMORY, "cannot connect: this process has no descriptors left"};
  const Deadline deadline = deadline_after(parts_.options.connect_timeout_ms);
  net::DialBackoff backoff;
  const auto token_for = [this](const std::string& address) { return tokens_.find(address); };
  for (;;) {
    auto admitted =
        admit(plan_.all(), parts_.options.dialling, hello(), deadline, parts_.stop, token_for);
    if (admitted) {
      if (take_over(std::move(*admitted), true)) break;
      return Failure{NIF_PROTOCOL, "the hub resumes a connection that never was"};
    }
    const bool again = parts_.options.wait_for_hub && may_come(admitted.error().status);
    if (!again || steady_now_ns() >= deadline) return admitted.error();
    const Deadline next = std::min(deadline, steady_now_ns() + backoff.next_ns(random_bits()));
    static_cast<void>(net::wait_for(nullptr, {}, parts_.stop, next));
  }
  try {
    const SignalsBlocked blocked;
    thread_ = std::thread([this] { run(); });
  } catch (const std::system_error&) {
    return Failure{NIF_NO_MEMORY, "cannot connect: the system has no thread left"};
  }
  return std::nullopt;
}

void NodeThread::stop() {
  parts_.stop.raise();
  parts_.wake.raise();
  if (thread_.joinable()) thread_.join();
}

bool NodeThread::is_current() const { return t_current == this; }

void NodeThread::set_task(Task task) {
  {
    const MutexLock lock(task_mutex_);
    has_task_.store(task != nullptr);
    task_ = std::move(task);
  }
  rouse();
}

void NodeThread::run_task() {
  if (!has_task_.load()) return;  // a turn of a program of NIF costs no lock
  const MutexLock lock(task_mutex_);
  task_at_ = task_ ? task_() : kNever;
}

bool NodeThread::take_over(Admitted admitted, bool first) {
  stream_ = std::move(admitted.stream);
  const bool same_id = admitted.session.id == session_.id;
  session_ = std::move(admitted.session);
  if (!first) parts_.outbound.begin_declaring();  // until declare_again() below knows better
  // Before anything can be posted: a total of the earlier connection would count as one of this.
  parts_.credits.begin(session_);
  const auto let_go = parts_.outbound.attach(*stream_, session_);
  if (!let_go) return false;
  parts_.id.store(session_.id, std::memory_order_relaxed);  // a number by itself
  const std::int64_t now = steady_now_ns();
  keep_alive_.begin(session_, now);
  if (session_.hub_time_ns != 0) parts_.clock.begin(session_.hub_time_ns, now);
  address_ = std::move(admitted.address);
  plan_.admitted(address_);
  keep_token();
  parts_.record.connected(session_, first);
  tell_connected(*let_go, first, same_id);
  parts_.credits.tell_all();
  inbound_.begin(session_);
  confirmed_ = inbound_.taken();
  if (!first) {
    parts_.declarations.declare_again({!session_.resumed, !session_.resumed || *let_go > 0});
    parts_.received.push(parts_.declarations.take_events());
    parts_.watches.declare_again();
  }
  return true;
}

void NodeThread::tell_connected(std::uint64_t let_go, bool first, bool same_id) {
  if (!first) {
    Record* event = make_event(NIF_CONNECTED, session_.earlier_goodbye);
    event->incoming.from = session_.id;
    event->incoming.flags = static_cast<std::uint8_t>(
        (session_.resumed ? NIF_CONNECTED_RESUMED : 0) | (same_id ? NIF_CONNECTED_SAME_ID : 0));
    parts_.push_event(event);
  }
  if (let_go == 0) return;
  Record* gap = make_event(NIF_GAP, proto::drop_reason_name(proto::DropReason::link_lost));
  gap->incoming.from = session_.id;
  gap->incoming.count = let_go;
  gap->incoming.reason = NIF_DROP_LINK_LOST;
  parts_.push_event(gap);
}

void NodeThread::take_new_name() {
  auto given = parts_.record.take_new_name();
  if (!given) return;
  name_ = std::move(given->name);
  session_.token = std::move(given->token);
  // The token is for the new name: a program that is started again under the former one could not
  // use it.
  tokens_.rename(name_);
  keep_token();
  parts_.declarations.declare_again({});  // services have other groups then, which tells
}

void NodeThread::run() {
  t_current = this;
  parts_.stop.set_beat([this] { run_task(); });  // no silent hub makes it late
  while (!parts_.closing.load()) {
    try {
      if (ended_) {
        delivery_.run();
        run_task();
        const net::Readiness ready = net::wait_for(nullptr, {}, parts_.wake, task_at_);
        if (ready.woken) parts_.wake.clear();
      } else if (stream_ != nullptr) {
        turn();
      } else {
        redial();
      }
    } catch (const std::bad_alloc&) {
      begin_epoch();  // half a step may be done: only a new one is sure to be right
      disconnect("the library ran out of memory", proto::GoodbyeCode::no_memory);
    }
  }
  try {
    leave();
  } catch (const std::bad_alloc&) {
    parts_.outbound.detach(false);  // without its last words
    stream_.reset();
  }
}

void NodeThread::turn() {
  const bool reading = parts_.received.has_room();
  if (reading != keep_alive_.is_reading()) keep_alive_.set_reading(reading, steady_now_ns());
  const Outbound::Wants wants = parts_.outbound.wants();
  if (wants.no_memory) throw std::bad_alloc();  // see run()
  if (wants.broken) {
    disconnect("the connection to the hub broke while writing", proto::GoodbyeCode::done);
    return;
  }
  const Deadline until = std::min(keep_alive_.next(wants.last_write_ns), task_at_);
  const net::Interest interest = net::interest_of(reading, wants.blocked, wants.pending_out);
  const net::Readiness ready = net::wait_for(stream_.get(), interest, parts_.wake, until);
  if (ready.woken) parts_.wake.clear();
  if (ready.woken || ready.writable) parts_.outbound.write_pending(ready.writable);
  const std::int64_t now = steady_now_ns();
  if (ready.readable) read_some(now);
  if (stream_ == nullptr) return;
  on_timers(now, wants.last_write_ns);
  if (stream_ != nullptr) {
    take_new_name();
    parts_.declarations.go_on();
    parts_.watches.go_on();
    parts_.received.push(parts_.declarations.take_events());
  }
  delivery_.run();
  run_task();
}

void NodeThread::read_some(std::int64_t now) {
  const auto space = inbound_.space();
  if (space.empty()) throw std::bad_alloc();
  const net::IoResult result = stream_->receive(space);
  if (result.status == net::IoStatus::would_block) return;
  if (result.status != net::IoStatus::ok) {
    disconnect("the hub closed the connection", proto::GoodbyeCode::done);
    return;
  }
  take_read(result.bytes, now);
}

void NodeThread::take_read(std::size_t bytes, std::int64_t now) {
  keep_alive_.heard(now);
  const Inbound::Verdict verdict = inbound_.take(bytes, {wall_now_ns(), now});
  parts_.record.count_read(bytes, inbound_.counts());
  switch (verdict) {
    case Inbound::Verdict::going:
      if (inbound_.confirm_due()) confirm();
      break;
    case Inbound::Verdict::goodbye:
      on_goodbye(inbound_.goodbye());
      break;
    case Inbound::Verdict::malformed: {
      const auto goodbye = net::encode_goodbye(proto::GoodbyeCode::malformed, inbound_.fault());
      static_cast<void>(parts_.outbound.post(goodbye));
      disconnect("the hub broke the protocol: " + inbound_.fault(), proto::GoodbyeCode::malformed);
      break;
    }
  }
}

void NodeThread::confirm() {
  if (!session_.resume || inbound_.taken() == confirmed_) return;
  if (!parts_.outbound.post(proto::flow::Confirm{inbound_.taken()})) return;
  confirmed_ = inbound_.taken();
  inbound_.confirmed();
}

void NodeThread::on_timers(std::int64_t now, std::int64_t written_ns) {
  if (keep_alive_.silent_for_too_long(now)) {
    disconnect("the hub was silent for too long", proto::GoodbyeCode::silent);
    return;
  }
  if (keep_alive_.is_early(now)) return;
  if (!keep_alive_.ping_due(written_ns, now) && !keep_alive_.is_late(now)) return;
  const Outbound::Wants wants = parts_.outbound.wants();  // others may have written since
  const bool due = keep_alive_.ping_due(wants.last_write_ns, now);
  if (!due && !keep_alive_.is_late(now)) return;
  keep_alive_.ticked(now);
  plan_.lasted();  // only now: a hub that admits and closes at once must not be dialed in a tight
                   // loop
  confirm();
  // While the kernel is full the hub does not read, so it cannot miss a PING, and they must not
  // pile up.
  if (due && !wants.blocked) {
    keep_alive_.pinged(now);
    parts_.outbound.post(parts_.clock.ping(steady_now_ns(), wall_now_ns()));
  }
  parts_.outbound.look_after_held();
  static_cast<void>(parts_.outbound.flush());
}

void NodeThread::redial() {
  const Deadline wait_until = steady_now_ns() + plan_.wait_ns(random_bits());
  while (!parts_.closing.load() && steady_now_ns() < wait_until) {
    const net::Readiness ready =
        net::wait_for(nullptr, {}, parts_.wake, std::min(wait_until, task_at_));
    if (ready.woken) parts_.wake.clear();
    delivery_.run();
    run_task();
  }
  if (parts_.closing.load()) return;
  take_new_name();
  const std::int64_t now = steady_now_ns();
  auto admitted = admit(plan_.addresses(now), parts_.options.dialling, hello(), plan_.deadline(now),
                        parts_.stop);
  if (!admitted) {
    if (admitted.error().status == NIF_CLOSED) return;
    parts_.record.set_last_error(admitted.error().sentence);
    if (!plan_.dials_again(admitted.error(), steady_now_ns()))
      end_of_dialing(std::move(admitted.error()));
    return;
  }
  if (plan_.resumes_only() && !admitted->session.resumed) return turn_down(std::move(*admitted));
  if (!take_over(std::move(*admitted), false)) {
    begin_epoch();
    disconnect("the hub's counts are impossible", proto::GoodbyeCode::malformed);
    return;
  }
  parts_.outbound.write_pending(true);
}

void NodeThread::end_of_dialing(Failure failure) {
  if (plan_.resumes_only() && failure.status != NIF_REPLACED) {
    failure = {NIF_NOT_CONNECTED,
               "the connection to the hub broke, and could not be resumed: " + failure.sentence};
    parts_.record.set_last_error(failure.sentence);
  }
  end(failure, failure.sentence, proto::GoodbyeCode::done);
}

void NodeThread::turn_down(Admitted admitted) {
  const auto goodbye = net::encode_goodbye(proto::GoodbyeCode::done, "");
  const iovec piece{const_cast<std::byte*>(goodbye.data()), goodbye.size()};
  static_cast<void>(admitted.stream->send({&piece, 1}));
  const std::string why =
      "the connection to the hub broke, and it does not know this session any more";
  parts_.record.set_last_error(why);
  end({NIF_NOT_CONNECTED, why}, why, proto::GoodbyeCode::done);
}

void NodeThread::on_goodbye(const proto::Goodbye& goodbye) {
  std::string why = std::string("the hub said goodbye: ") + proto::goodbye_name(goodbye.code);
  if (!goodbye.sentence.empty()) why += ": " + goodbye.sentence;
  disconnect(std::move(why), goodbye.code);
}

void NodeThread::disconnect(std::string why, proto::GoodbyeCode code) {
  const std::optional<Failure> ending = plan_.broke(why, code, session_, steady_now_ns());
  parts_.outbound.detach(!ending);
  stream_.reset();
  parts_.requests.fail_all();
  parts_.names.clear();
  parts_.clock.clear();
  parts_.record.disconnected(ending ? ending->sentence : why, ending.has_value());
  if (ending) {
    end(*ending, std::move(why), code);
  } else {
    Record* event = make_event(NIF_DISCONNECTED, std::move(why));
    event->incoming.reason = static_cast<std::uint32_t>(code);
    parts_.push_event(event);
  }
  delivery_.run();
}

/// The last event, and what calls answer from now on.
void NodeThread::end(const Failure& failure, std::string why, proto::GoodbyeCode code) {
  ended_ = true;
  tokens_.release();
  const bool replaced = failure.status == NIF_REPLACED;
  parts_.record.ended(replaced);
  Record* event = make_event(replaced ? NIF_SESSION_REPLACED : NIF_DISCONNECTED, std::move(why));
  event->incoming.reason = static_cast<std::uint32_t>(code);
  event->incoming.flags = replaced ? 0 : NIF_DISCONNECTED_FOR_GOOD;
  parts_.outbound.end(failure);  // first: whoever has the event finds the calls answer by it
  parts_.push_event(event);
  parts_.received.end(failure);
}

/// The last words: what waits, then GOODBYE, and then nothing is sent, but what the hub still says
/// is read, so that closing does not throw away what is on its way to it.
void NodeThread::leave() {
  if (stream_ == nullptr) return;
  const Deadline deadline = steady_now_ns() + kLeaveNs;
  const auto goodbye = net::encode_goodbye(proto::GoodbyeCode::done, "");
  parts_.outbound.begin_leaving(session_.resume ? inbound_.taken() : 0, goodbye);
  bool unsaid = true;
  while ((unsaid = parts_.outbound.write_last()) && steady_now_ns() < deadline) {
    static_cast<void>(net::wait_for(stream_.get(), {.write = true}, parts_.wake, deadline));
    parts_.wake.clear();
  }
  if (!unsaid && !parts_.outbound.wants().broken) tokens_.forget();  // GOODBYE makes it worthless
  stream_->shut_down();
  std::byte memory[4096];
  for (;;) {
    const net::IoResult result = stream_->receive(memory);
    if (steady_now_ns() >= deadline) break;  // also of a hub that never ends
    if (result.status == net::IoStatus::ok) continue;
    if (result.status != net::IoStatus::would_block) break;
    const net::Interest interest = net::interest_of(true, false, stream_->pending_out());
    const net::Readiness ready = net::wait_for(stream_.get(), interest, parts_.wake, deadline);
    if (ready.writable && stream_->send({}).status == net::IoStatus::failed) break;
    parts_.wake.clear();
  }
  parts_.outbound.detach(false);
  stream_.reset();
}

}  // namespace gimnet::nif
