#pragma once

#include <array>
#include <atomic>
#include <cstdint>
#include <span>

#include "client/nif/credit_book.hpp"
#include "client/nif/options.hpp"
#include "client/nif/outbound.hpp"
#include "client/nif/receive_queue.hpp"

namespace gimnet::nif {

/// Gives the program's callback what waits in the receive queue, as long as it takes it. Thread
/// safety: run() on the library's thread, again() on any.
class CallbackDelivery {
 public:
  /// `closing` is set when the node closes: nothing is delivered any more.
  CallbackDelivery(const Options& options, ReceiveQueue& received, Outbound& outbound,
                   CreditBook& credits, const std::atomic<bool>& closing)
      : options_(options),
        received_(received),
        outbound_(outbound),
        credits_(credits),
        closing_(closing) {}

  void run();
  /// The callback, which said NIF_NOT_NOW, has room again.
  void again() { again_calls_.fetch_add(1); }

 private:
  [[nodiscard]] std::size_t give(std::span<const Item> items);

  const Options& options_;
  ReceiveQueue& received_;
  Outbound& outbound_;
  CreditBook& credits_;
  const std::atomic<bool>& closing_;

  std::atomic<std::uint32_t> again_calls_{0};

  // The library's thread.
  std::array<Item, 64> in_hand_;  ///< taken out of the receive queue under one lock
  bool held_ = false;             ///< the callback said NIF_NOT_NOW ...
  std::uint32_t held_at_ = 0;     ///< ... after so many again()
};

}  // namespace gimnet::nif
