#pragma once

#include <cstddef>
#include <cstdint>
#include <cstdlib>
#include <memory>

#include "base/ids.hpp"
#include "hub/observe/counters.hpp"

namespace gimnet::hub {

/// How many bytes wait for each session of a shard, as last written by it: 0 for everybody who takes what it is sent.
/// Thread safety: set() by the shard, queued_bytes() from any thread. Limits: slots from `slots` on read as 0.
class QueueGauges {
 public:
  explicit QueueGauges(std::size_t slots)
      : slots_(slots), bytes_(static_cast<Counter*>(std::calloc(slots, sizeof(Counter)))) {}

  void set(ConnectionSlot slot, std::uint64_t bytes) {
    if (bytes_ && slot.value() < slots_) bytes_[slot.value()].store(bytes);
  }
  [[nodiscard]] std::uint64_t queued_bytes(ConnectionSlot slot) const {
    return bytes_ && slot.value() < slots_ ? bytes_[slot.value()].value() : 0;
  }

 private:
  struct Free {
    void operator()(Counter* counters) const { std::free(counters); }
  };
  const std::size_t slots_;
  // Zeroed memory that the kernel hands out page by page: a slot that was never slow costs nothing.
  std::unique_ptr<Counter[], Free> bytes_;
};

}  // namespace gimnet::hub
