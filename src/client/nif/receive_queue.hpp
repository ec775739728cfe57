#pragma once

#include <cstddef>
#include <deque>
#include <memory>
#include <span>

#include "base/mutex.hpp"
#include "client/nif/error.hpp"
#include "client/nif/storage.hpp"
#include "gimnet/nif.h"
#include "net/wait.hpp"

namespace gimnet::nif {

/// Items that were received and wait for the program, in order, bounded in bytes. It overwrites
/// nothing: who fills it asks has_room() before reading more, so it exceeds its limit by at most
/// what one read brings. Thread safety: push() and has_room() from the library's thread, the rest
/// from any.
class ReceiveQueue {
 public:
  /// `room` is raised when there is room again after has_room() said no.
  ReceiveQueue(std::size_t bytes_max, net::WakeSignal& room) : bytes_max_(bytes_max), room_(room) {}
  ~ReceiveQueue();

  /// Takes over the items' references.
  void push(std::span<const Item> items) GIMNET_EXCLUDES(mutex_);
  /// Once it was full there is room only when half of it is free, so that reading does not stop and
  /// go with each message.
  [[nodiscard]] bool has_room() GIMNET_EXCLUDES(mutex_);

  /// Waits for the first; NIF_OK and at least one, or NIF_TIMEOUT, NIF_CLOSED, or what end() was
  /// given.
  [[nodiscard]] nif_status pop(std::span<nif_incoming> in, std::size_t& count, Deadline deadline)
      GIMNET_EXCLUDES(mutex_);

  /// For a consumer that may find that it has no room itself: takes out what waits, as far as it
  /// fits into `items`; returns how many. Then it gives back those that it could not see to, maybe
  /// none, which are first again. REQUIRES: one consumer, and it does not pop().
  [[nodiscard]] std::size_t take(std::span<Item> items) GIMNET_EXCLUDES(mutex_);
  void give_back(std::span<const Item> items) GIMNET_EXCLUDES(mutex_);

  /// Nothing more will come: when it is empty, pop() answers with this.
  void end(const Failure& failure) GIMNET_EXCLUDES(mutex_);
  /// Everybody who waits, and all that come later, answer NIF_CLOSED at once.
  void close() GIMNET_EXCLUDES(mutex_);

  /// A descriptor that is readable while something waits; -1: no descriptor left.
  [[nodiscard]] int event_descriptor() GIMNET_EXCLUDES(mutex_);
  [[nodiscard]] std::size_t bytes() GIMNET_EXCLUDES(mutex_);
  [[nodiscard]] std::uint64_t stops() GIMNET_EXCLUDES(mutex_);

 private:
  [[nodiscard]] Item take_first() GIMNET_REQUIRES(mutex_);
  void after_removal() GIMNET_REQUIRES(mutex_);

  const std::size_t bytes_max_;
  net::WakeSignal& room_;

  Mutex mutex_;
  Condition filled_;
  std::deque<Item> items_
      GIMNET_GUARDED_BY(mutex_);  ///< Limit: bytes_max_, and what one read brings
  std::size_t bytes_ GIMNET_GUARDED_BY(mutex_) = 0;
  bool stopped_ GIMNET_GUARDED_BY(mutex_) = false;
  bool closed_ GIMNET_GUARDED_BY(mutex_) = false;
  Failure end_ GIMNET_GUARDED_BY(mutex_);  ///< NIF_OK: more may come
  std::unique_ptr<net::WakeSignal> event_ GIMNET_GUARDED_BY(mutex_);
  std::uint64_t stops_ GIMNET_GUARDED_BY(mutex_) = 0;
};

}  // namespace gimnet::nif
