#pragma once

#include <cstdint>
#include <functional>
#include <map>
#include <string>

#include "proto/control/ctrl.hpp"
#include "tests/stress/support/raw_node.hpp"

namespace gimnet::stress {

/// The counters of a hub, all shards together, as CTRL STATISTICS tells them.
class Statistics {
 public:
  /// REQUIRES: no data frames are on their way to `observer`.
  static Statistics of(RawNode& observer);
  explicit Statistics(const proto::ctrl::StatisticsAnswer& answer);

  /// REQUIRES: the hub has a counter of that name.
  [[nodiscard]] std::uint64_t operator[](const std::string& name) const {
    return counters_.at(name);
  }
  /// The same of a counter that the hub only tells where it is not 0: the conductor's.
  [[nodiscard]] std::uint64_t told(const std::string& name) const {
    const auto found = counters_.find(name);
    return found == counters_.end() ? 0 : found->second;
  }
  /// Of one shard alone. REQUIRES: the hub has that shard and a counter of that name.
  [[nodiscard]] std::uint64_t of_shard(std::size_t shard, const std::string& name) const {
    return by_shard_.at(shard).at(name);
  }
  /// Sum over all reasons.
  [[nodiscard]] std::uint64_t dropped() const;
  /// accepted + copies = delivered + dropped + queued.
  [[nodiscard]] bool is_balanced() const;
  [[nodiscard]] bool has_the_ledger_of(const Statistics& other) const;
  /// All counters that are not zero, for messages.
  [[nodiscard]] std::string text() const;

 private:
  std::map<std::string, std::uint64_t> counters_;
  std::map<std::size_t, std::map<std::string, std::uint64_t>> by_shard_;
};

/// The counts of the hub as soon as nothing moves: twice in a row the same ledger, which is exact.
/// Throws, with the last counters, when there is no such moment.
[[nodiscard]] Statistics wait_for_exact_ledger(RawNode& observer);

/// Asks until the condition holds, and returns what held; throws, with the last counters, when time
/// is over.
[[nodiscard]] Statistics wait_for(RawNode& observer,
                                  const std::function<bool(const Statistics&)>& condition,
                                  const std::string& what);

}  // namespace gimnet::stress
