#include <algorithm>
#include <new>
#include <span>
#include <utility>

#include "base/random.hpp"
#include "client/nif/node.hpp"
#include "net/dial_handshake.hpp"

// The library's thread: reads, keeps alive, writes what senders left to it, calls back, dials
// again.

namespace gimnet::nif {
namespace {

/// nif_close() goes on this long to write what waits.
constexpr std::int64_t kLeaveNs = 1'000'000'000;
/// The longest try of a reconnect.
constexpr std::int64_t kRedialNs = 5'000'000'000;
/// So long after a break the former hub alone is dialled: there the session can go on.
constexpr std::int64_t kFormerHubNs = 1'000'000'000;
/// Keep-alive intervals after which the hub's clock is measured again, however busy the node is.
constexpr std::int64_t kMeasureIntervals = 5;

thread_local constinit const Node* t_node = nullptr;

/// While it lives the program's callback may be running.
class InCallbacks {
 public:
  explicit InCallbacks(Outbound& outbound) : outbound_(outbound) { outbound_.begin_callbacks(); }
  ~InCallbacks() { outbound_.end_callbacks(); }
  InCallbacks(const InCallbacks&) = delete;
  InCallbacks& operator=(const InCallbacks&) = delete;

 private:
  Outbound& outbound_;
};

}  // namespace

bool Node::in_callback() const { return t_node == this; }

void Node::run() {
  t_node = this;
  stop_.set_beat([this] { run_task(); });  // no silent hub makes it late
  while (!closing_.load()) {
    try {
      if (ended_) {
        call_back();
        run_task();
        const net::Readiness ready = net::wait_for(nullptr, {}, wake_, task_at_);
        if (ready.woken) wake_.clear();
      } else if (stream_ != nullptr) {
        turn();
      } else {
        redial();
      }
    } catch (const std::bad_alloc&) {
      epoch_ = random_bits() | 1;  // half a step may be done: only a new one is sure to be right
      session_.hub_epoch = 0;
      disconnect("the library ran out of memory", proto::GoodbyeCode::no_memory);
    }
  }
  try {
    leave();
  } catch (const std::bad_alloc&) {
    outbound_.detach(false);  // without its last words
    stream_.reset();
  }
}

Deadline Node::next_timer(bool reading, std::int64_t last_write_ns) const {
  Deadline next = std::min(last_tick_ns_, last_write_ns) + session_.keep_alive_ns;
  next = std::max(next, last_tick_ns_ + session_.keep_alive_ns / 4);
  if (reading) next = std::min(next, last_heard_ns_ + session_.silent_after_ns);
  return next;
}

void Node::turn() {
  const bool reading = received_.has_room();
  // Nothing was heard because nobody listened: the hub gets its whole time again.
  if (reading && !was_reading_) last_heard_ns_ = steady_now_ns();
  was_reading_ = reading;
  const Outbound::Wants wants = outbound_.wants();
  if (wants.no_memory) throw std::bad_alloc();  // see run()
  if (wants.broken) {
    disconnect("the connection to the hub broke while writing", proto::GoodbyeCode::done);
    return;
  }
  const Deadline until = std::min(next_timer(reading, wants.last_write_ns), task_at_);
  const net::Interest interest = net::interest_of(reading, wants.blocked, wants.pending_out);
  const net::Readiness ready = net::wait_for(stream_.get(), interest, wake_, until);
  if (ready.woken) wake_.clear();
  if (ready.woken || ready.writable) outbound_.write_pending(ready.writable);
  const std::int64_t now = steady_now_ns();
  if (ready.readable) read_some(now);
  if (stream_ == nullptr) return;
  if (!ready.readable) on_timers(now, reading);
  if (stream_ != nullptr) {
    take_new_name();
    declarations_.go_on();
    watches_.go_on();
    received_.push(declarations_.take_events());
  }
  call_back();
  run_task();
}

void Node::set_task(Task task) {
  {
    const MutexLock lock(task_mutex_);
    has_task_.store(task != nullptr);
    task_ = std::move(task);
  }
  rouse();
}

void Node::run_task() {
  if (!has_task_.load()) return;  // a turn of a program of NIF costs no lock
  const MutexLock lock(task_mutex_);
  task_at_ = task_ ? task_() : kNever;
}

void Node::read_some(std::int64_t now) {
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

void Node::take_read(std::size_t bytes, std::int64_t now) {
  last_heard_ns_ = now;
  const Inbound::Verdict verdict = inbound_.take(bytes, {wall_now_ns(), now});
  {
    const MutexLock lock(mutex_);
    bytes_received_ += bytes;
    ++read_calls_;
    inbound_counts_ = inbound_.counts();
  }
  switch (verdict) {
    case Inbound::Verdict::going:
      if (inbound_.confirm_due()) confirm();
      break;
    case Inbound::Verdict::goodbye:
      on_goodbye(inbound_.goodbye());
      break;
    case Inbound::Verdict::malformed: {
      const auto goodbye = net::encode_goodbye(proto::GoodbyeCode::malformed, inbound_.fault());
      static_cast<void>(outbound_.post(goodbye));
      disconnect("the hub broke the protocol: " + inbound_.fault(), proto::GoodbyeCode::malformed);
      break;
    }
  }
  if (stream_ != nullptr && now - last_tick_ns_ >= session_.keep_alive_ns) on_timers(now, true);
}

void Node::confirm() {
  if (!session_.resume || inbound_.taken() == confirmed_) return;
  if (!outbound_.post(proto::flow::Confirm{inbound_.taken()})) return;
  confirmed_ = inbound_.taken();
  inbound_.confirmed();
}

void Node::on_timers(std::int64_t now, bool reading) {
  if (reading && now - last_heard_ns_ >= session_.silent_after_ns) {
    disconnect("the hub was silent for too long", proto::GoodbyeCode::silent);
    return;
  }
  if (now - last_tick_ns_ < session_.keep_alive_ns / 4) return;
  const Outbound::Wants wants = outbound_.wants();
  const bool due = now - wants.last_write_ns >= session_.keep_alive_ns ||
                   now - last_ping_ns_ >= kMeasureIntervals * session_.keep_alive_ns;
  if (!due && now - last_tick_ns_ < session_.keep_alive_ns) return;
  last_tick_ns_ = now;
  backoff_.reset();  // only now: a hub that admits and closes at once must not be dialed in a tight
                     // loop
  confirm();
  // While the kernel is full the hub does not read, so it cannot miss a PING, and they must not
  // pile up.
  if (due && !wants.blocked) {
    last_ping_ns_ = now;
    outbound_.post(clock_.ping(steady_now_ns(), wall_now_ns()));
  }
  outbound_.look_after_held();
  static_cast<void>(outbound_.flush());
}

/// Gives the program what waits, as long as it takes it.
void Node::call_back() {
  if (options_.callback == nullptr) return;
  if (held_ && deliver_calls_.load() == held_at_) return;
  held_ = false;
  std::size_t count = closing_.load() ? 0 : received_.take(in_hand_);
  if (count == 0) return;
  const InCallbacks in_callbacks(
      outbound_);  // for all of them: between two batches nothing is written
  while (count > 0) {
    const std::span<const Item> taken(in_hand_.data(), count);
    received_.give_back(taken.subspan(call_back_with(taken)));
    const bool more = !held_ && !closing_.load() && count == in_hand_.size();
    count = more ? received_.take(in_hand_) : 0;
  }
}

/// Returns how many the program took; fewer than there are if it has no room (`held_`), or the node
/// closes.
std::size_t Node::call_back_with(std::span<const Item> items) {
  std::size_t taken = 0;
  while (taken < items.size() && !closing_.load()) {
    nif_incoming in = incoming_of(items[taken]);
    const std::uint32_t calls = deliver_calls_.load();
    const nif_verdict verdict = options_.callback(options_.user, &in);
    if (verdict == NIF_NOT_NOW) {
      if (deliver_calls_.load() != calls) continue;  // room came while it was asked
      held_ = true;
      held_at_ = calls;
      break;
    }
    ++taken;
    const bool credited = verdict == NIF_DONE || !options_.credit_by_program;
    if (credited && in.epoch != 0) credits_.take(in.to, in.epoch, 1, false);
    if (verdict == NIF_DONE) nif_release(&in);
  }
  return taken;
}

void Node::redial() {
  const Deadline wait_until = steady_now_ns() + backoff_.next_ns(random_bits());
  while (!closing_.load() && steady_now_ns() < wait_until) {
    const net::Readiness ready = net::wait_for(nullptr, {}, wake_, std::min(wait_until, task_at_));
    if (ready.woken) wake_.clear();
    call_back();
    run_task();
  }
  if (closing_.load()) return;
  take_new_name();
  Deadline deadline = steady_now_ns() + kRedialNs;
  if (resumes_only_) deadline = std::min(deadline, broke_ns_ + session_.grace_ns);
  auto admitted = admit(hubs_to_dial(), options_.dialling, hello(), deadline, stop_);
  if (!admitted) {
    if (admitted.error().status == NIF_CLOSED) return;
    set_last_error(admitted.error().sentence);
    if (!dials_again(admitted.error())) end_of_dialing(std::move(admitted.error()));
    return;
  }
  if (resumes_only_ && !admitted->session.resumed) return turn_down(std::move(*admitted));
  if (!take_over(std::move(*admitted), false)) {
    epoch_ = random_bits() | 1;
    session_.hub_epoch = 0;
    disconnect("the hub's counts are impossible", proto::GoodbyeCode::malformed);
    return;
  }
  outbound_.write_pending(true);
}

std::span<const net::Address> Node::hubs_to_dial() const {
  const bool may_be_back = !hub_ends_ && steady_now_ns() - broke_ns_ < kFormerHubNs;
  const std::size_t most = resumes_only_ || may_be_back ? 1 : addresses_.size();
  return std::span(addresses_).first(std::min(most, addresses_.size()));
}

bool Node::dials_again(const Failure& failure) const {
  if (failure.status == NIF_REPLACED) return false;
  // A node that dials only because it was given another id (`renumbered`) has one try.
  if (!resumes_only_) return options_.reconnect;
  // A session that a hub keeps is gone with its process.
  return !failure.nobody_listens && steady_now_ns() - broke_ns_ < session_.grace_ns;
}

void Node::end_of_dialing(Failure failure) {
  if (resumes_only_ && failure.status != NIF_REPLACED) {
    failure = {NIF_NOT_CONNECTED,
               "the connection to the hub broke, and could not be resumed: " + failure.sentence};
    set_last_error(failure.sentence);
  }
  end(failure, failure.sentence, proto::GoodbyeCode::done);
}

void Node::turn_down(Admitted admitted) {
  const auto goodbye = net::encode_goodbye(proto::GoodbyeCode::done, "");
  const iovec piece{const_cast<std::byte*>(goodbye.data()), goodbye.size()};
  static_cast<void>(admitted.stream->send({&piece, 1}));
  const std::string why =
      "the connection to the hub broke, and it does not know this session any more";
  set_last_error(why);
  end({NIF_NOT_CONNECTED, why}, why, proto::GoodbyeCode::done);
}

bool Node::may_resume(proto::GoodbyeCode code) const {
  const bool kept = code == proto::GoodbyeCode::done || code == proto::GoodbyeCode::silent ||
                    code == proto::GoodbyeCode::slow_consumer ||
                    code == proto::GoodbyeCode::stalled_frame;
  return options_.dials_to_resume && session_.resume && session_.grace_ns > 0 && kept;
}

void Node::on_goodbye(const proto::Goodbye& goodbye) {
  std::string why = std::string("the hub said goodbye: ") + proto::goodbye_name(goodbye.code);
  if (!goodbye.sentence.empty()) why += ": " + goodbye.sentence;
  disconnect(std::move(why), goodbye.code);
}

/// The answer of calls if no connection follows one that ended so; nothing: the library dials
/// again.
std::optional<Failure> Node::ending_of(const std::string& why, proto::GoodbyeCode code) const {
  switch (code) {
    case proto::GoodbyeCode::replaced:
      return Failure{NIF_REPLACED, why + "; end the other program, or connect under another name"};
    case proto::GoodbyeCode::kicked:
      return Failure{NIF_REFUSED, why};
    case proto::GoodbyeCode::renumbered:
      return std::nullopt;  // not told to go: it comes back whatever else it does at a break
    default:
      if (options_.reconnect || may_resume(code)) return std::nullopt;
      return Failure{NIF_NOT_CONNECTED, why};
  }
}

void Node::disconnect(std::string why, proto::GoodbyeCode code) {
  const std::optional<Failure> ending = ending_of(why, code);
  resumes_only_ = may_resume(code);
  hub_ends_ = code == proto::GoodbyeCode::draining;
  broke_ns_ = steady_now_ns();
  outbound_.detach(!ending);
  stream_.reset();
  requests_.fail_all();
  names_.clear();
  clock_.clear();
  set_disconnected(ending ? ending->sentence : why, ending.has_value());
  if (ending) {
    end(*ending, std::move(why), code);
  } else {
    Record* event = make_event(NIF_DISCONNECTED, std::move(why));
    event->incoming.reason = static_cast<std::uint32_t>(code);
    push_event(event);
  }
  call_back();
}

void Node::set_disconnected(const std::string& why, bool for_good) {
  const MutexLock lock(mutex_);
  info_.connected = 0;
  info_.ended = for_good ? 1 : 0;
  last_error_ = why;
}

/// The last event, and what calls answer from now on.
void Node::end(const Failure& failure, std::string why, proto::GoodbyeCode code) {
  ended_ = true;
  tokens_.release();
  const bool replaced = failure.status == NIF_REPLACED;
  {
    const MutexLock lock(mutex_);
    info_.token_kept = 0;
    info_.replaced = replaced ? 1 : 0;
    info_.ended = 1;
  }
  Record* event = make_event(replaced ? NIF_SESSION_REPLACED : NIF_DISCONNECTED, std::move(why));
  event->incoming.reason = static_cast<std::uint32_t>(code);
  event->incoming.flags = replaced ? 0 : NIF_DISCONNECTED_FOR_GOOD;
  push_event(event);
  outbound_.end(failure);
  received_.end(failure);
}

/// The last words: what waits, then GOODBYE, and then nothing is sent, but what the hub still says
/// is read, so that closing does not throw away what is on its way to it.
void Node::leave() {
  if (stream_ == nullptr) return;
  const Deadline deadline = steady_now_ns() + kLeaveNs;
  const auto goodbye = net::encode_goodbye(proto::GoodbyeCode::done, "");
  outbound_.begin_leaving(session_.resume ? inbound_.taken() : 0, goodbye);
  bool unsaid = true;
  while ((unsaid = outbound_.write_last()) && steady_now_ns() < deadline) {
    static_cast<void>(net::wait_for(stream_.get(), {.write = true}, wake_, deadline));
    wake_.clear();
  }
  if (!unsaid && !outbound_.wants().broken) tokens_.forget();  // GOODBYE makes it worthless
  stream_->shut_down();
  std::byte memory[4096];
  for (;;) {
    const net::IoResult result = stream_->receive(memory);
    if (steady_now_ns() >= deadline) break;  // also of a hub that never ends
    if (result.status == net::IoStatus::ok) continue;
    if (result.status != net::IoStatus::would_block) break;
    const net::Interest interest = net::interest_of(true, false, stream_->pending_out());
    const net::Readiness ready = net::wait_for(stream_.get(), interest, wake_, deadline);
    if (ready.writable && stream_->send({}).status == net::IoStatus::failed) break;
    wake_.clear();
  }
  outbound_.detach(false);
  stream_.reset();
}

}  // namespace gimnet::nif
