#include "hub/shard/io_shard.hpp"

#include <pthread.h>

#include <algorithm>
#include <cstddef>
#include <string>

#include "base/clock.hpp"
#include "hub/shard/control_frame.hpp"
#include "hub/shard/flow_words.hpp"

namespace gimnet::hub {

namespace {

constexpr std::int64_t kNsPerMs = 1'000'000;

template <class... Handlers>
struct Overloaded : Handlers... {
  using Handlers::operator()...;
};

}  // namespace

IoShard::IoShard(ShardIndex index, const HubShared& shared, Options options)
    : state_(index, shared),
      closer_(state_),
      flusher_(state_, closer_),
      reader_(state_, closer_),
      attacher_(state_, closer_),
      keeper_(state_, closer_, flusher_, reader_),
      commands_(1),
      options_(options) {
  Waker& waker = *shared.wakers[index.value()];
  GIMNET_CHECK(state_.poller.add(waker.descriptor(), Poller::kOwnToken,
                                 Interest{.read = true, .write = false}));
}

IoShard::~IoShard() { join(); }

void IoShard::start() {
  thread_ = std::thread([this] { run(); });
  const std::string name = "shard-" + std::to_string(state_.self.value());
  ::pthread_setname_np(thread_.native_handle(), name.c_str());
}

void IoShard::join() {
  if (thread_.joinable()) thread_.join();
}

void IoShard::let_go() {
  state_.connections.clear();
  reader_.let_go();
  const auto end_loan = [](const Mail& mail) {
    if (mail.lent != nullptr) BufferPool::end_loan(mail.lent);
    return true;
  };
  state_.shared.mailboxes[state_.self.value()]->drain(SIZE_MAX, [] {}, end_loan);
}

void IoShard::send(ShardCommand command) {
  commands_.push(0, std::move(command));
  state_.shared.wakers[state_.self.value()]->wake();
}

void IoShard::run() {
  meter_ = AllocationMeter();
  while (!stopped_) {
    const std::span<const Ready> ready = wait();
    turn(ready, static_cast<std::uint64_t>(steady_now_ns() / kNsPerMs));
  }
  state_.shared.quiescence.leave(state_.self.value());
  state_.egress.owner.let_go();  // who joins this thread clears up
}

std::span<const Ready> IoShard::wait() {
  Waker& waker = *state_.shared.wakers[state_.self.value()];
  std::uint64_t until_ms = options_.spin ? Poller::kNow : wake_at_ms();
  if (until_ms != Poller::kNow) {
    state_.shared.quiescence.leave(state_.self.value());
    waker.prepare_to_sleep();
    if (has_work()) until_ms = Poller::kNow;
  }
  const std::span<const Ready> ready = state_.poller.wait_until(until_ms);
  waker.awake();
  return ready;
}

std::uint64_t IoShard::wake_at_ms() {
  if (flush_again_ || !state_.recipients.dirty().empty() || has_rest()) return Poller::kNow;
  std::uint64_t at_ms = std::min(keeper_.next_tick_at_ms(), state_.pacer.next_due_ms());
  if (state_.drops.pending()) {
    at_ms = std::min(at_ms,
                     state_.now_ms + std::max<std::uint64_t>(1, state_.limits.report_interval_ms));
  }
  return at_ms > state_.now_ms ? at_ms : Poller::kNow;
}

bool IoShard::has_rest() const {
  if (reader_.has_rest_of_mail()) return true;
  return std::any_of(state_.with_rest.begin(), state_.with_rest.end(), [this](std::uint64_t token) {
    const Connection* connection = state_.find_token(token);
    return connection != nullptr && connection->armed.read;
  });
}

bool IoShard::has_work() {
  return !commands_.empty() || !state_.shared.mailboxes[state_.self.value()]->empty() ||
         room_came();
}

/// The word that a mailbox has room is said once, and is only heard asleep: one that came since the
/// last look is found by looking, and the next one wakes.
bool IoShard::room_came() {
  if (state_.waiting_for_room.empty()) return false;
  const std::uint64_t before = state_.fanout.crowded();
  state_.fanout.look_for_room();
  room_came_ = room_came_ || state_.fanout.crowded() != before;
  return room_came_;
}

void IoShard::turn(std::span<const Ready> ready, std::uint64_t now_ms) {
  state_.egress.owner.check_here();
  state_.now_ms = state_.egress.now_ms = now_ms;
  state_.egress.now_wall_ns = wall_now_ns();
  state_.shared.quiescence.enter(state_.self.value());
  state_.budget.begin_turn(now_ms);
  if (!state_.recipients.links().empty()) state_.link_budget.begin_turn(now_ms);
  take_commands();
  take_mail();
  keeper_.look_for_others();
  if (state_.with_rest.empty()) {
    serve(ready);
  } else {
    going_on_.swap(state_.with_rest);
    serve(ready);
    go_on();
  }
  read_waiting();
  keeper_.tick();
  state_.pacer.release_due();
  flush();
  state_.signals.send_reports();
  finish_turn();
}

void IoShard::take_commands() {
  if (commands_.empty()) return;
  commands_.drain(kCommandsPerTurn, [this](ShardCommand&& command) { execute(command); });
}

void IoShard::take_mail() {
  Mailbox& mailbox = *state_.shared.mailboxes[state_.self.value()];
  if (mailbox.empty() && !reader_.has_rest_of_mail()) return;
  reader_.begin_mail();
  if (!reader_.take_rest_of_mail()) return;
  // A session whose node was seen by another shard has its AttachCommand waiting here: first all
  // commands, then the frames.
  const auto before_taking = [this] {
    while (!commands_.empty()) take_commands();
  };
  // Waiting frames are charged to the budget when they are flushed. A mailbox full of the smallest
  // frames would go far beyond the budget before that.
  std::uint64_t unflushed = 0;
  mailbox.drain(kMailPerTurn, before_taking, [&](const Mail& mail) {
    const bool goes_on = reader_.take_mail(mail);
    unflushed += mail.size;
    if (unflushed >= kReadBytesPerFlush) {
      flush();
      unflushed = 0;
    }
    return goes_on;
  });
  mailbox.tell_room([this](ShardIndex sender) { state_.shared.wakers[sender.value()]->wake(); });
}

void IoShard::serve(std::span<const Ready> ready) {
  std::uint64_t flushed_at = state_.tally.received_bytes;
  for (const Ready& each : ready) {
    if (each.token == Poller::kOwnToken) {
      state_.shared.wakers[state_.self.value()]->clear();
      continue;
    }
    Connection* connection = state_.find_token(each.token);
    if (connection == nullptr) continue;
    if (each.writable && connection->armed.write) flusher_.on_writable(*connection);
    if (each.readable && connection->armed.read) reader_.read(*connection);
    if (state_.tally.received_bytes - flushed_at >= kReadBytesPerFlush) {
      flush();
      flushed_at = state_.tally.received_bytes;
    }
  }
}

/// Others were read before.
void IoShard::go_on() {
  for (const std::uint64_t token : going_on_) {
    Connection* connection = state_.find_token(token);
    if (connection == nullptr) continue;
    connection->goes_on = false;
    if (!connection->armed.read) {
      state_.go_on_later(*connection);
    } else if (connection->gate.has(ReadGate::rest)) {
      reader_.go_on(*connection);
    } else {
      reader_.read(*connection);
    }
  }
  going_on_.clear();
}

void IoShard::read_waiting() {
  if (!room_came()) return;
  room_came_ = false;
  // Each waits for those shards only to which it sends.
  std::erase_if(state_.waiting_for_room, [this](Connection* connection) {
    if ((connection->posted_shards & state_.fanout.crowded()) != 0) return false;
    connection->gate.clear(ReadGate::no_room);
    connection->on_read_again(state_.now_ms);
    state_.signals.arm(*connection);
    return true;
  });
}

void IoShard::flush() { flush_again_ = flusher_.flush_dirty(); }

void IoShard::finish_turn() {
  state_.counters.turns.add(1);
  state_.counters.mailbox_wakeups.add(state_.fanout.take_wakeups());
  if (state_.is_scarce()) state_.counters.scarce_turns.add(1);
  state_.counters.pinned_bytes.store(state_.pool.pinned_bytes());
  state_.counters.pinned_bytes_max.raise_to(state_.pool.pinned_bytes());
  state_.counters.allocated_bytes.store(meter_.bytes());
  state_.tally.publish(state_.counters);
  if (keeper_.take_drained()) state_.tell_conductor({state_.self, DrainedEvent{}});
}

void IoShard::execute(ShardCommand& command) {
  std::visit(Overloaded{
                 [&](AttachCommand& attach) { attacher_.attach(std::move(attach)); },
                 [&](SendControlCommand& control) {
                   Connection* connection = state_.find(control.session);
                   if (connection == nullptr || !connection->connected) return;
                   if (control.attachment != 0 && control.attachment != connection->attachment)
                     return;
                   connection->requests -= std::min(control.answers, connection->requests);
                   if (control.counts)
                     state_.pacer.begin_counts(*connection, control.counts->group,
                                               control.counts->number);
                   if (control.passed_on) return pass_on(*connection, control.frame);
                   if (control.may_drop) return say_event(*connection, control.frame);
                   say(*connection, control.frame);
                 },
                 [&](TellCommand& told) { tell(told); },
                 [&](const TellAgainCommand& told) { tell_again(told); },
                 [&](CloseCommand& close) {
                   Connection* connection = state_.find(close.session);
                   if (connection == nullptr) return;
                   if (close.most_ms != 0 && connection->is_link()) {
                     connection->link->ending.emplace(std::move(close), state_.now_ms);
                   } else {
                     closer_.close(*connection, close.code, std::move(close.sentence));
                   }
                 },
                 [&](ReleaseCommand& release) { closer_.release(release.session); },
                 [&](RenumberCommand& renumber) {
                   if (Connection* connection = state_.find(renumber.session)) {
                     closer_.close(*connection, proto::GoodbyeCode::renumbered,
                                   std::move(renumber.sentence));
                     attacher_.renumber(*connection, renumber.node);
                   }
                 },
                 [&](const LinkClockCommand& clock) {
                   Connection* connection = state_.find(clock.session);
                   if (connection != nullptr && connection->is_link())
                     connection->link->clock_ahead_ns = clock.ahead.count();
                 },
                 [&](const LimitsCommand& changed) { state_.limits = changed.limits; },
                 [&](PaceCommand& pace) { begin_pace(pace); },
                 [&](EndPaceCommand& end) {
                   if (Connection* connection = state_.find(end.session)) {
                     state_.pacer.unsubscribe(*connection, end.group);
                   }
                 },
                 [&](ForgetRetainedCommand& forget) {
                   state_.retained.forget(forget.group, forget.provider);
                 },
                 [&](DrainCommand& drain) { keeper_.drain(drain.deadline_ms); },
                 [&](StopCommand&) { stopped_ = true; },
             },
             command);
}

void IoShard::pass_on(Connection& connection, std::span<const std::byte> frame) {
  if (connection.outbox.push_control(frame, state_.egress))
    return state_.recipients.mark_dirty(connection);
  state_.counters.too_many_requests.add(1);
}

void IoShard::say(Connection& connection, std::span<const std::byte> frame) {
  const std::uint64_t most = connection.is_link() ? kLinkControlBytes : state_.limits.control_bytes;
  if (connection.outbox.push_control(frame, state_.egress, most))
    return state_.recipients.mark_dirty(connection);
  closer_.close(connection, proto::GoodbyeCode::too_many_requests,
                "answers wait and are not taken; read what you asked for");
}

void IoShard::tell(TellCommand& command) {
  for (const TellCommand::To& to : command.to) {
    Connection* connection = state_.find(to.session);
    if (connection == nullptr || !connection->connected) continue;
    set_destination(command.frame, to.node);
    say_event(*connection, command.frame);
  }
}

void IoShard::say_event(Connection& connection, std::span<const std::byte> frame) {
  if (connection.events != EventState::told) return;
  if (!connection.outbox.push_control(frame, state_.egress, state_.limits.control_bytes / 2))
    connection.events = EventState::missed;
  state_.recipients.mark_dirty(connection);
}

void IoShard::tell_again(const TellAgainCommand& command) {
  Connection* connection = state_.find(command.session);
  if (connection == nullptr || !connection->connected ||
      connection->attachment != command.attachment)
    return;
  connection->events = EventState::told;
  connection->outbox.push_first_control(command.frames, state_.egress);
  state_.recipients.mark_dirty(*connection);
}

void IoShard::begin_pace(const PaceCommand& command) {
  Connection* connection = state_.find(command.session);
  if (connection == nullptr) return;
  const bool begins = Pacer::find(*connection, command.group) == nullptr;
  const bool misses = connection->connected && connection->events != EventState::told;
  if (begins && misses && command.with_event) return;
  PacedSubscription& subscription = state_.pacer.subscribe(
      *connection, command.group, command.terms, command.was_plain, command.number);
  subscription.retained = command.retained;
  subscription.by_queue = connection->is_link();
  if (begins && command.retained) state_.retained.ask_start(subscription);
}

}  // namespace gimnet::hub
