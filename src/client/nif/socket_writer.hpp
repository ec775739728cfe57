#pragma once

#include <cstddef>
#include <cstdint>

#include "base/mutex.hpp"
#include "client/nif/connection_state.hpp"
#include "client/nif/error.hpp"
#include "client/nif/frame_appender.hpp"
#include "client/nif/send_queue.hpp"
#include "net/stream.hpp"
#include "net/wait.hpp"

namespace gimnet::nif {

/// The threads that wait in calls until the sending half changes.
/// Thread safety: guarded by its owner, whose mutex wait() gives up meanwhile.
class Waiters {
 public:
  /// Until notify(), or until the deadline; or earlier, so the caller asks again what it waits for.
  /// False: the time is up.
  bool wait(Mutex& mutex, Deadline deadline) GIMNET_REQUIRES(mutex) {
    ++count_;
    const bool in_time = changed_.wait_until(mutex, deadline);
    --count_;
    return in_time;
  }
  /// Something changed: all of them look.
  void notify() {
    if (count_ > 0) changed_.notify_all();
  }
  [[nodiscard]] std::uint32_t count() const { return count_; }

 private:
  Condition changed_;
  std::uint32_t count_ = 0;
};

/// Writes a send queue to its socket, and decides which thread does.
///
/// A thread that put a message into the queue becomes the writer, unless another one is (which
/// takes the message along), the kernel is full, or messages come so fast one after another that
/// writing is left to the library's thread, which gathers them. One small message on an idle
/// connection is one system call in the caller's thread.
///
/// Thread safety: guarded by its owner. Functions that take the owner's mutex give it up while they
/// write, gather or wait: everything may be different when they return. Errors: where there is no
/// memory for a write the connection ends, see give_up().
class SocketWriter {
 public:
  /// Has more frames for the queue than are in it.
  class Source {
   public:
    /// Before each write: puts into the queue what may go now. May throw std::bad_alloc.
    virtual void refill() = 0;
    /// Something is left for another refill().
    [[nodiscard]] virtual bool has_more() const = 0;

   protected:
    ~Source() = default;
  };
  struct Parts {
    SendQueue& queue;
    const AppendedBytes& appended;  ///< to `queue`
    Source& source;
    const ConnectionState& connection;
    Waiters& waiters;       ///< hear of each write
    net::WakeSignal& wake;  ///< rouses the library's thread, which then calls write_pending()
  };
  /// The parts outlive it.
  explicit SocketWriter(const Parts& parts) : parts_(parts) {}

  /// A connection stands.
  void attach(net::Stream& stream);
  /// When this returns nobody uses the stream any more. REQUIRES: the state is not connected() any
  /// more, which ends a writer's rounds.
  void detach(Mutex& mutex) GIMNET_REQUIRES(mutex);

  /// A message was put into the queue; `more`: its sender has another one that may go along.
  void write_or_leave(bool more, Mutex& mutex) GIMNET_REQUIRES(mutex);
  /// Writes if there is something to write and nobody else does. True: it tried.
  [[nodiscard]] bool write_here(Mutex& mutex) GIMNET_REQUIRES(mutex);
  /// The library's thread writes what waits, as far as the kernel takes it. `writable`: it has room
  /// again after it was full.
  void write_pending(bool writable, Mutex& mutex) GIMNET_REQUIRES(mutex);
  /// The library's thread calls the program back from now on, until end_callbacks(): nothing is
  /// left to it meanwhile, and what was left to it before is written now.
  void begin_callbacks(Mutex& mutex) GIMNET_REQUIRES(mutex);
  void end_callbacks() { in_callbacks_ = false; }
  /// Writes in any state of the connection. True: more is left.
  [[nodiscard]] bool write_last(Mutex& mutex) GIMNET_REQUIRES(mutex);

  /// Memory ran out, so that the queue is not in order: nothing is written any more, and the
  /// library's thread ends the connection.
  void give_up();
  /// Until begin_anew() only SendQueue::drop_all() is right.
  [[nodiscard]] bool no_memory() const { return no_memory_; }
  void begin_anew() { no_memory_ = false; }

  /// Frames may be put into the queue.
  [[nodiscard]] bool usable() const { return parts_.connection.connected() && !no_memory_; }
  /// Somebody is in a write, or gathers for one.
  [[nodiscard]] bool writing() const { return writing_; }
  /// write_or_leave() would write, as far as the kernel has room.
  [[nodiscard]] bool ready() const {
    return parts_.connection.connected() && !writing_ && !broken_;
  }
  /// The kernel has all that was queued.
  [[nodiscard]] bool all_sent() const {
    return parts_.queue.all_written() && (stream_ == nullptr || stream_->pending_out() == 0);
  }
  /// The state of writing, by which the library's thread waits.
  struct Wants {
    bool blocked = false;            ///< the kernel was full
    std::size_t pending_out = 0;     ///< as Stream::pending_out(); 0 while somebody writes
    bool broken = false;             ///< a write failed
    bool no_memory = false;          ///< because there was no memory for it
    std::int64_t last_write_ns = 0;  ///< when bytes went last
  };
  [[nodiscard]] Wants wants() const;
  [[nodiscard]] std::uint64_t bytes_sent() const { return bytes_sent_; }
  [[nodiscard]] std::uint64_t write_calls() const { return write_calls_; }

 private:
  [[nodiscard]] bool in_burst();
  [[nodiscard]] bool gather_burst(Mutex& mutex) GIMNET_REQUIRES(mutex);
  void write_rounds(bool by_library, Mutex& mutex) GIMNET_REQUIRES(mutex);
  [[nodiscard]] bool write_once(Mutex& mutex) GIMNET_REQUIRES(mutex);
  [[nodiscard]] bool write_gathered(Mutex& mutex) GIMNET_REQUIRES(mutex);
  void end_writing();
  void wake_library();

  const Parts parts_;
  net::Stream* stream_ = nullptr;
  bool writing_ = false;  ///< somebody is between gather() and commit()
  bool full_ = false;     ///< the kernel took less than was offered
  bool broken_ = false;
  bool no_memory_ = false;
  bool wake_raised_ = false;
  bool in_callbacks_ = false;  ///< the library's thread cannot write
  std::int64_t last_write_ns_ = 0;
  std::uint32_t quick_sends_ = 0;
  std::uint64_t bytes_sent_ = 0;
  std::uint64_t write_calls_ = 0;
};

}  // namespace gimnet::nif
