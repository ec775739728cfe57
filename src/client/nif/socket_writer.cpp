#include "client/nif/socket_writer.hpp"

#include <algorithm>
#include <new>
#include <thread>
#include <utility>

#include "base/clock.hpp"

namespace gimnet::nif {
namespace {

/// After so many writes in a row a sender leaves the rest to the library's thread: its own message
/// went long ago.
constexpr int kWriteRoundsMax = 8;
/// A send that follows the last write, or the send before, within this time is part of a burst.
constexpr std::int64_t kQuickNs = 3'000;
/// No longer than this is a burst gathered for one write.
constexpr std::int64_t kGatherNsMax = 100'000;
/// From one look at whether it goes on to the next.
constexpr std::int64_t kLookNs = 1'000;
/// With NIF_FLAG_MORE this much is written anyway.
constexpr std::size_t kHeldBytesMax = 64 * 1024;
/// After so many quick sends in a row gathering them pays for the wake-up of the library's thread.
constexpr std::uint32_t kQuickSends = 4;

}  // namespace

void SocketWriter::attach(net::Stream& stream) {
  stream_ = &stream;
  full_ = false;
  broken_ = false;
  last_write_ns_ = steady_now_ns();
}

void SocketWriter::detach(Mutex& mutex) {
  while (writing_) static_cast<void>(parts_.waiters.wait(mutex, kNever));
  stream_ = nullptr;
  full_ = false;
}

void SocketWriter::wake_library() {
  if (wake_raised_) return;
  wake_raised_ = true;
  parts_.wake.raise();
}

void SocketWriter::give_up() {
  broken_ = no_memory_ = true;
  wake_library();
}

/// One gathered write. False: nothing waits, or the kernel takes no more.
bool SocketWriter::write_once(Mutex& mutex) {
  if (no_memory_) return false;
  try {
    return write_gathered(mutex);
  } catch (const std::bad_alloc&) {
    give_up();  // the sender of the message has its answer already
    return false;
  }
}

bool SocketWriter::write_gathered(Mutex& mutex) {
  parts_.source.refill();
  const auto pieces = parts_.queue.gather();
  net::Stream& stream = *stream_;
  if (pieces.empty() && stream.pending_out() == 0) return false;
  std::size_t offered = 0;
  for (const iovec& piece : pieces) offered += piece.iov_len;
  mutex.unlock();
  const net::IoResult result = stream.send(pieces);
  mutex.lock();
  ++write_calls_;
  bytes_sent_ += result.bytes;
  parts_.queue.commit(result.bytes);
  if (result.bytes > 0) parts_.waiters.notify();
  broken_ = broken_ || result.status == net::IoStatus::failed;
  // A callback's time is not waited for: see write_or_leave().
  full_ = !broken_ && (result.bytes < offered || stream.pending_out() != 0);
  return !broken_ && !full_;
}

/// Also where nothing was written: detach() waits for the writer, and so does whoever wants the
/// queue empty, where it is that already.
void SocketWriter::end_writing() {
  writing_ = false;
  parts_.waiters.notify();
}

void SocketWriter::write_rounds(bool by_library, Mutex& mutex) {
  writing_ = true;
  const std::uint64_t sent_before = bytes_sent_;
  // Messages that came during the write of a burst are gathered again, after a look at the socket.
  const int rounds_max = by_library && gather_burst(mutex) ? 1 : kWriteRoundsMax;
  int rounds = 0;
  // While the library's thread is in a callback nobody else would write the rest.
  while ((rounds < rounds_max || in_callbacks_) && parts_.connection.connected() &&
         write_once(mutex))
    ++rounds;
  end_writing();
  // A write of nothing tells the hub nothing: keep-alive must not count it.
  if (bytes_sent_ != sent_before) last_write_ns_ = steady_now_ns();
  const bool more =
      rounds >= rounds_max && (!parts_.queue.all_written() || parts_.source.has_more());
  // The library's thread sees for itself that the kernel is full: waking it would only make it try
  // again at once.
  if (more || (!by_library && (full_ || broken_))) wake_library();
}

bool SocketWriter::in_burst() {
  const bool quick = steady_now_ns() - last_write_ns_ < kQuickNs;
  quick_sends_ = quick ? std::min(quick_sends_ + 1, kQuickSends) : 0;
  return quick_sends_ == kQuickSends;
}

/// The library's thread, woken because of a burst: lets messages gather as long as they come one
/// right after the other, so that a write takes hundreds of them along. It gives its processor to
/// whoever wants it and does not sleep: when they stop coming they are written at once. Without it
/// bursts of 16 B have 0.68 times the messages a second, for 1.36 times the processor time of all
/// (median of 8 pairs, one hub, TCP, two processors). False: there is no burst, or enough of it.
bool SocketWriter::gather_burst(Mutex& mutex) {
  const std::size_t waiting_bytes = parts_.queue.unsent_bytes();
  if (quick_sends_ < kQuickSends || waiting_bytes >= AppendedBytes::kBurst) return false;
  if (parts_.waiters.count() > 0) return false;
  const std::uint64_t enough = parts_.appended.value() + AppendedBytes::kBurst - waiting_bytes;
  mutex.unlock();
  std::uint64_t appended = 0;
  const std::int64_t begin = steady_now_ns();
  for (std::int64_t now = begin, last = begin; now - last < kQuickNs && now - begin < kGatherNsMax;
       now = steady_now_ns()) {
    const std::uint64_t before = std::exchange(appended, parts_.appended.value());
    if (appended >= enough) break;
    if (appended != before) last = now;
    std::this_thread::yield();
    // A look at the senders' memory slows them down, and a yield is a system call.
    while (steady_now_ns() - now < kLookNs) {
    }
  }
  mutex.lock();
  return true;
}

void SocketWriter::write_or_leave(bool more, Mutex& mutex) {
  if (!ready() || no_memory_) return;
  if (more && parts_.queue.unsent_bytes() < kHeldBytesMax) return;
  if (!in_callbacks_) {
    if (full_) return;  // the library's thread waits for the kernel
    if (wake_raised_ && quick_sends_ == kQuickSends) return;  // it comes, and takes this along
    if (in_burst()) {
      wake_library();
      return;
    }
  }
  write_rounds(false, mutex);
}

bool SocketWriter::write_here(Mutex& mutex) {
  if (!ready() || full_ || all_sent()) return false;
  const std::uint64_t before = write_calls_;
  write_rounds(false, mutex);
  return write_calls_ != before;
}

void SocketWriter::write_pending(bool writable, Mutex& mutex) {
  wake_raised_ = false;
  if (!ready() || (full_ && !writable)) return;
  full_ = false;
  write_rounds(true, mutex);
}

void SocketWriter::begin_callbacks(Mutex& mutex) {
  in_callbacks_ = true;
  // Not gathered, since what is left behind one write would wait for the program.
  if (wake_raised_ && ready() && !full_) write_rounds(false, mutex);
}

bool SocketWriter::write_last(Mutex& mutex) {
  while (writing_) static_cast<void>(parts_.waiters.wait(mutex, kNever));
  if (stream_ == nullptr || broken_) return false;
  writing_ = true;
  while (write_once(mutex)) {
  }
  end_writing();
  return !broken_ && !all_sent();
}

SocketWriter::Wants SocketWriter::wants() const {
  const bool idle = !writing_ && stream_ != nullptr;
  return {full_ && !writing_, idle ? stream_->pending_out() : 0, broken_, no_memory_,
          last_write_ns_};
}

}  // namespace gimnet::nif
