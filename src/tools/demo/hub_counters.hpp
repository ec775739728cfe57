#pragma once

#include <cstdint>
#include <string>
#include <string_view>
#include <vector>

namespace gimnet::demo {

/// What the hub counted, summed over its shards: the ledger of docs/protocol.md, section 9. Thread
/// safety: one thread.
struct HubCounters {
  struct Drop {
    std::string reason;
    std::uint64_t frames = 0;
  };

  std::uint64_t accepted = 0;
  std::uint64_t copies = 0;
  std::uint64_t delivered = 0;
  std::uint64_t queued = 0;
  /// Reasons with at least one frame.
  std::vector<Drop> drops;

  /// Adds one counter of one shard, by its name in docs/operations.md; others than the ledger's are
  /// passed over.
  void add(std::string_view name, std::uint64_t value);

  [[nodiscard]] std::uint64_t dropped() const;
  /// Is accepted + copies = delivered + dropped + queued? Holds exactly whenever nothing moves.
  [[nodiscard]] bool exact() const { return accepted + copies == delivered + dropped() + queued; }
  /// The drops in words, as "3 queue_full, 1 away"; "none" without any.
  [[nodiscard]] std::string drops_text() const;
};

}  // namespace gimnet::demo
