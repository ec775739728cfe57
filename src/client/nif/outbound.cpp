#include "client/nif/outbound.hpp"

#include <array>
#include <new>
#include <utility>

namespace gimnet::nif {
namespace {

/// Of a PING that asks for a CONFIRM; HubClock, which counts from 1, takes its PONG for nothing
/// that it asked.
constexpr std::uint32_t kAskSequence = 0;

}  // namespace

void Outbound::refill() {
  if (under_way_.holds_any() && (connection_.connected() || leaving_)) {
    const MessagesUnderWay::Put put = under_way_.put_held(gate_, frames_);
    lost_ |= put.lost;
    if (put.ended) waiters_.notify();
  }
  if (leaving_ && queue_.all_written() && !goodbye_.empty()) {
    frames_.append_control(goodbye_);
    goodbye_.clear();
  }
}

/// As with Inside, which asks twice whether an exception is on its way: that takes one twentieth of
/// the instructions of a small message.
nif_status Outbound::send(Outgoing& message, Deadline deadline) {
  const MutexLock lock(mutex_);
  try {
    return sender_.send(message, deadline, mutex_);
  } catch (...) {
    writer_.give_up();
    throw;
  }
}

nif_status Outbound::flush() {
  const MutexLock lock(mutex_);
  if (!connection_.connected()) return connection_.not_connected();
  static_cast<void>(writer_.write_here(mutex_));
  return NIF_OK;
}

/// The hub says by itself only now and then what it took, but always when it is asked by a PING.
/// True: it was asked. One question at a time: the answer to an earlier one may be all that is
/// wanted, and if not the next one follows it.
bool Outbound::ask_for_confirm() {
  if (asked_ || !writer_.ready() || !queue_.all_written()) return false;
  frames_.append_flow(proto::flow::Ping{kAskSequence, wall_now_ns()});
  asked_ = true;
  write_or_leave();
  return true;
}

nif_status Outbound::drain(Deadline deadline) {
  const Inside inside(*this);
  for (;;) {
    if (connection_.ended()) return connection_.not_connected();
    if (connection_.away() && !queue_.resume()) return connection_.not_connected();
    // An empty queue proves nothing once something was thrown out of it.
    if (std::exchange(lost_, false)) {
      return fail(NIF_NOT_CONNECTED,
                  "the connection was lost before everything was confirmed; some of it may not "
                  "have arrived");
    }
    const bool nothing_waits = writer_.all_sent() && !under_way_.holds_any() && !writer_.writing();
    if (nothing_waits && queue_.retained_bytes() == 0) return NIF_OK;
    if (writer_.write_here(mutex_) || ask_for_confirm()) continue;
    if (deadline != kNever && steady_now_ns() >= deadline) {
      return fail(NIF_TIMEOUT, "not everything was written and confirmed within the time given");
    }
    static_cast<void>(waiters_.wait(mutex_, deadline));
  }
}

void Outbound::look_after_held() {
  const Inside inside(*this);
  if (pauses_.lift_overdue(hub_of(NodeId{frames_.id()}), steady_now_ns())) waiters_.notify();
  if (!connection_.connected() || !under_way_.holds_any()) return;
  under_way_.ask_for_receivers(frames_);
  write_or_leave();
}

/// The queue goes on, or begins anew. As attach().
std::optional<std::uint64_t> Outbound::take_up(const SessionTerms& session) {
  std::uint64_t missing = 0;
  if (session.resumed) {
    const auto skipped = queue_.resume_from(session.hub_taken);
    if (!skipped) return std::nullopt;
    missing = *skipped;
    lost_ |= missing > 0;
  } else {
    lost_ |= queue_.retained_bytes() > 0;
    queue_.restart(session.id);
    lost_ |= under_way_.begin_epoch();
  }
  queue_.set_resume(session.resume);
  return missing;
}

std::optional<std::uint64_t> Outbound::attach(net::Stream& stream, const SessionTerms& session) {
  const Inside inside(*this);
  const std::optional<std::uint64_t> missing = take_up(session);
  if (!missing) return std::nullopt;
  frames_.begin_session(session.id, session.frame_bytes_max);
  sender_.set_hub_retains(session.retained_bytes_max);
  pauses_.clear();
  writer_.attach(stream);
  asked_ = false;
  if (*missing > 0) frames_.append_flow(proto::flow::Skip{proto::DropReason::link_lost, *missing});
  // A handle that is being closed stays closed: whoever waits in it leaves, and nobody else comes
  // in.
  connection_.connect();
  waiters_.notify();
  return missing;
}

void Outbound::detach(bool again) {
  const MutexLock lock(mutex_);
  connection_.lose();
  writer_.detach(mutex_);
  pauses_.clear();
  bool in_order = !writer_.no_memory();
  try {
    if (in_order) queue_.disconnect();
  } catch (const std::bad_alloc&) {
    in_order = false;
  }
  if (!again || !queue_.resume() || !in_order) {
    lost_ |= !in_order || !queue_.all_written() || queue_.retained_bytes() > 0;
    static_cast<void>(queue_.drop_all());
    lost_ |= under_way_.drop_held();
    writer_.begin_anew();
  }
  waiters_.notify();
}

void Outbound::end(const Failure& failure) {
  const MutexLock lock(mutex_);
  connection_.end(failure);
  waiters_.notify();
}

void Outbound::begin_leaving(std::uint64_t taken, std::span<const std::byte> goodbye) {
  const Inside inside(*this);
  if (taken != 0) frames_.append_flow(proto::flow::Confirm{taken});
  goodbye_.assign(goodbye.begin(), goodbye.end());
  leaving_ = true;
  // Nobody hears where the services are now.
  if (queue_.held_back()) lost_ |= queue_.go_on({}) > 0;
}

bool Outbound::write_last() {
  const MutexLock lock(mutex_);
  return writer_.write_last(mutex_);
}

nif_status Outbound::wait_connected(Deadline deadline) {
  const MutexLock lock(mutex_);
  for (;;) {
    if (connection_.connected()) return NIF_OK;
    if (connection_.ended()) return connection_.not_connected();
    if (deadline != kNever && steady_now_ns() >= deadline) return connection_.not_connected();
    static_cast<void>(waiters_.wait(mutex_, deadline));
  }
}

void Outbound::write_pending(bool writable) {
  const MutexLock lock(mutex_);
  writer_.write_pending(writable, mutex_);
}

void Outbound::begin_callbacks() {
  const MutexLock lock(mutex_);
  writer_.begin_callbacks(mutex_);
}

void Outbound::end_callbacks() {
  const MutexLock lock(mutex_);
  writer_.end_callbacks();
}

Outbound::Wants Outbound::wants() {
  const MutexLock lock(mutex_);
  return writer_.wants();
}

bool Outbound::post(std::span<const std::byte> frame) {
  const Inside inside(*this);
  if (!writer_.usable()) return false;
  frames_.append_control(frame);
  write_or_leave();
  return true;
}

bool Outbound::post(const proto::flow::Message& message) {
  std::array<std::byte, proto::flow::kFrameSizeMax> frame;
  const std::size_t size = proto::flow::encode_frame(message, NodeId{0}, frame);
  return post(std::span<const std::byte>(frame).first(size));
}

bool Outbound::post_data(std::span<const std::byte> frame) {
  const Inside inside(*this);
  const proto::FrameHeader header = proto::load_header(frame.data());
  if (pauses_.is_paused(stream_code(header.kind, header.lane, header.dst))) return false;
  if (!writer_.usable()) return false;
  frames_.append_frame(frame);
  write_or_leave();
  return true;
}

void Outbound::follow_retained(const std::string& service, std::uint32_t group) {
  const MutexLock lock(mutex_);
  last_.follow(service, group);
}

void Outbound::forget_retained(const std::string& service) {
  const MutexLock lock(mutex_);
  last_.forget(service);
}

void Outbound::send_last_again(const std::string& service) {
  const Inside inside(*this);
  const LastMessage* const last = last_.find(service);
  if (last == nullptr || !writer_.usable()) return;
  if (under_way_.goes_on(last->header)) return;  // a newer one, which is about to be the last
  frames_.append_last(*last);
  write_or_leave();
}

void Outbound::begin_declaring() {
  const MutexLock lock(mutex_);
  moves_.begin();
}

std::uint64_t Outbound::readdress(const SendQueue::GroupMap& moves) {
  const Inside inside(*this);
  moves_.add(moves);
  const std::uint64_t lost = queue_.held_back() ? queue_.go_on(moves) : 0;
  lost_ |= lost > 0;
  return lost;
}

void Outbound::end_declaring() {
  const MutexLock lock(mutex_);
  moves_.end();
  waiters_.notify();
  write_or_leave();
}

void Outbound::forget_moves(std::uint32_t group) {
  const MutexLock lock(mutex_);
  moves_.forget(group);
}

std::uint32_t Outbound::waiting() {
  const MutexLock lock(mutex_);
  return waiters_.count();
}

std::uint32_t Outbound::id() {
  const MutexLock lock(mutex_);
  return frames_.id();
}

void Outbound::on_pause(const proto::flow::Target& target) {
  const MutexLock lock(mutex_);
  ++pause_count_;
  pauses_.pause(target, steady_now_ns());
}

void Outbound::on_resume(const proto::flow::Target& target) {
  const MutexLock lock(mutex_);
  pauses_.resume(target);
  waiters_.notify();
  write_held();
}

bool Outbound::on_confirm(std::uint64_t count) {
  const MutexLock lock(mutex_);
  const bool possible = queue_.confirm(count);
  asked_ = false;
  waiters_.notify();
  write_held();
  return possible;
}

void Outbound::give_up(std::uint64_t tag) {
  const MutexLock lock(mutex_);
  under_way_.refuse(tag);
  waiters_.notify();
  write_held();
}

std::optional<proto::Report> Outbound::on_taken(std::uint32_t from, const proto::Taken& taken) {
  const MutexLock lock(mutex_);
  const auto report = under_way_.on_taken(from, taken);
  waiters_.notify();
  write_held();
  return report;
}

bool Outbound::on_report(const proto::Report& report) {
  const MutexLock lock(mutex_);
  // About a service, and not about a message that was lost: the program did not have to ask.
  if (report.reason == proto::DropReason::not_retained) return false;
  under_way_.on_report(report);
  waiters_.notify();
  // An answer to a question of the library, unless others are merged with it.
  if (report.header.kind == proto::Kind::taken && report.count <= 1) return true;
  return !sender_.reports_wanted();
}

std::optional<ReportedMessages::Start> Outbound::message_of(const proto::Report& report) {
  const MutexLock lock(mutex_);
  return sender_.message_of(report);
}

void Outbound::add_counters(nif_counters& counters) {
  const MutexLock lock(mutex_);
  counters.messages_sent = sender_.messages_sent();
  counters.frames_sent = queue_.frames_written();
  counters.frames_resent = queue_.frames_resent();
  counters.frames_let_go = queue_.frames_let_go();
  counters.frames_replaced = queue_.frames_replaced();
  counters.bytes_sent = writer_.bytes_sent();
  counters.write_calls = writer_.write_calls();
  counters.pauses = pause_count_;
  counters.send_queue_bytes = queue_.unsent_bytes() + under_way_.held_bytes();
  counters.retained_bytes = queue_.retained_bytes();
  counters.last_messages_not_kept = last_.not_kept();
}

}  // namespace gimnet::nif
