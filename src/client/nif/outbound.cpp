#include "client/nif/outbound.hpp"

#include <array>
#include <new>

namespace gimnet::nif {
namespace {

/// After so many writes in a row a sender leaves the rest to the library's thread: its own message
/// went long ago.
constexpr int kWriteRoundsMax = 8;

}  // namespace

bool Outbound::wait(Deadline deadline) {
  ++waiting_;
  const bool in_time = changed_.wait_until(mutex_, deadline);
  --waiting_;
  return in_time;
}

void Outbound::notify_waiting() {
  if (waiting_ > 0) changed_.notify_all();
}

void Outbound::wake_library() {
  if (wake_raised_) return;
  wake_raised_ = true;
  wake_.raise();
}

/// One gathered write. False: nothing waits, or the kernel takes no more.
bool Outbound::write_once() {
  if (no_memory_) return false;
  try {
    return write_gathered();
  } catch (const std::bad_alloc&) {
    on_no_memory();  // the sender of the message has its answer already
    return false;
  }
}

void Outbound::on_no_memory() {
  broken_ = no_memory_ = true;
  wake_library();
}

bool Outbound::write_gathered() {
  if (!held_.empty()) put_held();
  if (leaving_ && queue_.all_written() && !goodbye_.empty()) {
    frames_.append_control(goodbye_);
    goodbye_.clear();
  }
  const auto pieces = queue_.gather();
  net::Stream& stream = *stream_;
  if (pieces.empty() && stream.pending_out() == 0) return false;
  std::size_t offered = 0;
  for (const iovec& piece : pieces) offered += piece.iov_len;
  mutex_.unlock();
  const net::IoResult result = stream.send(pieces);
  mutex_.lock();
  ++write_calls_;
  bytes_sent_ += result.bytes;
  queue_.commit(result.bytes);
  if (result.bytes > 0) notify_waiting();
  broken_ = broken_ || result.status == net::IoStatus::failed;
  // A callback's time is not waited for: see write_or_leave().
  full_ = !broken_ && (result.bytes < offered || stream.pending_out() != 0);
  return !broken_ && !full_;
}

/// Also where nothing was written: detach() waits for the writer, and drain() does where the queue
/// is empty already.
void Outbound::end_writing() {
  writing_ = false;
  notify_waiting();
}

void Outbound::write_rounds(bool by_library) {
  writing_ = true;
  // Messages that came during the write of a burst are gathered again, after a look at the socket.
  const int rounds_max = by_library && gather_burst() ? 1 : kWriteRoundsMax;
  int rounds = 0;
  // While the library's thread is in a callback nobody else would write the rest.
  while ((rounds < rounds_max || in_callbacks_) && connection_.connected() && write_once())
    ++rounds;
  end_writing();
  last_write_ns_ = steady_now_ns();
  const bool more = rounds >= rounds_max && (!queue_.all_written() || !held_.empty());
  // The library's thread sees for itself that the kernel is full: waking it would only make it try
  // again at once.
  if (more || (!by_library && (full_ || broken_))) wake_library();
}

void Outbound::write_pending(bool writable) {
  const MutexLock lock(mutex_);
  wake_raised_ = false;
  if (!connection_.connected() || writing_ || broken_ || (full_ && !writable)) return;
  full_ = false;
  write_rounds(true);
}

void Outbound::begin_callbacks() {
  const MutexLock lock(mutex_);
  in_callbacks_ = true;
  // Not gathered, since what is left behind one write would wait for the program.
  if (wake_raised_ && connection_.connected() && !writing_ && !full_ && !broken_)
    write_rounds(false);
}

void Outbound::end_callbacks() {
  const MutexLock lock(mutex_);
  in_callbacks_ = false;
}

Outbound::Wants Outbound::wants() {
  const MutexLock lock(mutex_);
  const bool idle = !writing_ && stream_ != nullptr;
  return {full_ && !writing_, idle ? stream_->pending_out() : 0, broken_, no_memory_,
          last_write_ns_};
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
  const proto::FrameHeader& header = last->header;
  const auto newer = in_progress_.find(stream_code(header.kind, header.lane, header.dst));
  if (newer != in_progress_.end() && newer->second->number != 0 &&
      newer->second->epoch == epochs_) {
    return;  // it goes on, and is about to be the last one
  }
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
  notify_waiting();
  write_or_leave(false);
}

void Outbound::forget_moves(std::uint32_t group) {
  const MutexLock lock(mutex_);
  moves_.forget(group);
}

std::uint32_t Outbound::waiting() {
  const MutexLock lock(mutex_);
  return waiting_;
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
  notify_waiting();
  if (!held_.empty()) write_or_leave(false);
}

bool Outbound::on_confirm(std::uint64_t count) {
  const MutexLock lock(mutex_);
  const bool possible = queue_.confirm(count);
  asked_ = false;
  notify_waiting();
  if (!held_.empty()) write_or_leave(false);
  return possible;
}

std::optional<proto::Report> Outbound::on_taken(std::uint32_t from, const proto::Taken& taken) {
  const MutexLock lock(mutex_);
  const auto report = held_.empty() ? std::nullopt : held_.report_of(from, taken);
  for (auto& [stream, progress] : in_progress_) {
    if (progress->number != taken.message || progress->dst != from || !progress->windowed) continue;
    static_cast<void>(progress->window.on_taken(taken));
    progress->refused |= taken.refuses();
    notify_waiting();
  }
  if (!held_.empty()) write_or_leave(false);
  return report;
}

bool Outbound::on_report(const proto::Report& report) {
  const MutexLock lock(mutex_);
  const proto::FrameHeader& header = report.header;
  // About a service, and not about a message that was lost: the program did not have to ask.
  if (report.reason == proto::DropReason::not_retained) return false;
  if (header.kind == proto::Kind::taken) {
    // Our own TAKENs ask for no reports, so this answers probe().
    for (auto& [stream, progress] : in_progress_) {
      if (progress->windowed && progress->dst == header.dst) progress->undelivered = report.reason;
    }
    notify_waiting();
    // Others may be merged with it.
    return report.count <= 1 || !reports_wanted_;
  }
  const auto found = in_progress_.find(stream_code(header.kind, header.lane, header.dst));
  const auto number = ReportedMessages::number_of(report);
  if (found != in_progress_.end() && found->second->windowed && header.has(proto::kFlagFragment) &&
      (!number || *number == found->second->number)) {
    SendProgress& progress = *found->second;
    // Why the rest of a message goes is what became of its beginning.
    const bool rest = report.reason == proto::DropReason::cut_message;
    if (!rest || progress.undelivered == proto::DropReason::none)
      progress.undelivered = report.reason;
    notify_waiting();
  }
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
  counters.bytes_sent = bytes_sent_;
  counters.write_calls = write_calls_;
  counters.pauses = pause_count_;
  counters.send_queue_bytes = queue_.unsent_bytes() + held_.bytes();
  counters.retained_bytes = queue_.retained_bytes();
  counters.last_messages_not_kept = last_.not_kept();
}

}  // namespace gimnet::nif
