#include <new>

#include "client/nif/outbound.hpp"

// A connection comes, breaks, or is left for good, and messages go on whose senders do not wait.

namespace gimnet::nif {

void Outbound::look_after_held() {
  const Inside inside(*this);
  if (pauses_.lift_overdue(hub_of(NodeId{frames_.id()}), steady_now_ns())) waiters_.notify();
  if (!connection_.connected() || !under_way_.holds_any()) return;
  under_way_.ask_for_receivers(frames_);
  write_or_leave(false);
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
  hub_retains_ = session.retained_bytes_max;
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

}  // namespace gimnet::nif
