#include "client/nif/outbound.hpp"

#include <array>

namespace gimnet::nif {
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
  if (!usable()) return false;
  frames_.append_control(frame);
  write_or_leave(false);
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
  if (!usable()) return false;
  frames_.append_frame(frame);
  write_or_leave(false);
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
  if (last == nullptr || !usable()) return;
  if (under_way_.goes_on(last->header)) return;  // a newer one, which is about to be the last
  frames_.append_last(*last);
  write_or_leave(false);
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
  write_or_leave(false);
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
  return !reports_wanted_;
}

std::optional<ReportedMessages::Start> Outbound::message_of(const proto::Report& report) {
  const MutexLock lock(mutex_);
  return reported_.find(report);
}

void Outbound::add_counters(nif_counters& counters) {
  const MutexLock lock(mutex_);
  counters.messages_sent = messages_sent_;
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
