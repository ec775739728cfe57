#pragma once

#include <chrono>
#include <cstdint>
#include <optional>
#include <unordered_map>
#include <vector>

#include "hub/control/state/due_list.hpp"

namespace gimnet::hub {

/// The indices that a pool may hand out to newcomers: `count` of them from `first` on, cyclically. What lies below was
/// handed out before a restart and waits for those who come back.
struct IndexRange {
  std::uint32_t first = 1;
  std::uint64_t count = kAll;
  static constexpr std::uint64_t kAll = std::uint64_t{1} << 62;
};

/// Hands out indices 1..most cyclically. An index that was given back rests before it can come again, so that frames
/// still under way to its former holder never reach a stranger.
/// Thread safety: none. Limits: `most` indices; one bit each.
class IndexPool {
 public:
  /// What is granted at a time: how far the mark that outlives a crash is ahead of what is in use.
  static constexpr std::uint32_t kBlock = 4'096;

  /// REQUIRES: 0 < range.first <= most, range.count > 0.
  IndexPool(std::uint32_t most, std::chrono::milliseconds resting_time, const IndexRange& range = {});

  /// The next index that is granted and neither held nor resting; nothing if there is none.
  [[nodiscard]] std::optional<std::uint32_t> take(std::chrono::milliseconds now);
  /// That index, granted or not, if nobody holds it and it does not rest.
  [[nodiscard]] bool take_free(std::uint32_t index, std::chrono::milliseconds now);
  /// That index, if nobody holds it: for its former holder, for whom it need not rest.
  [[nodiscard]] bool take_back(std::uint32_t index);
  /// REQUIRES: the index is held.
  void give_back(std::uint32_t index, std::chrono::milliseconds now);
  [[nodiscard]] bool held(std::uint32_t index) const;
  [[nodiscard]] std::uint32_t held() const { return held_; }

  /// Is less than half a block left of what was granted?
  [[nodiscard]] bool runs_short() const { return count_ - reached_ < kBlock / 2; }
  /// How many indices were granted, counted from the first; more than there are where they come round again.
  [[nodiscard]] std::uint64_t count() const { return count_; }
  /// How many to grant next.
  [[nodiscard]] std::uint64_t next_count() const { return count_ + kBlock; }
  /// Where a pool has to begin that must not hand out any of `count` indices.
  [[nodiscard]] std::uint32_t mark(std::uint64_t count) const { return index_at(count); }
  /// From now on `count` indices may be handed out, counted from the first. REQUIRES: no fewer than before.
  void grant(std::uint64_t count);

 private:
  struct Resting {
    std::chrono::milliseconds until;
    std::uint32_t index;
  };
  [[nodiscard]] std::uint32_t index_at(std::uint64_t position) const;
  [[nodiscard]] bool granted(std::uint32_t index) const;
  [[nodiscard]] bool still_rests(const Resting& note) const;
  [[nodiscard]] bool taken(std::uint32_t index) const { return index < taken_.size() && taken_[index]; }
  void mark_taken(std::uint32_t index);
  void wake(std::chrono::milliseconds now);

  const std::uint32_t most_;
  const std::chrono::milliseconds resting_time_;
  const std::uint32_t first_;
  std::uint64_t count_;
  std::uint64_t position_ = 0;       ///< of the next one; index_at() tells which that is
  std::uint64_t reached_ = 0;        ///< the furthest position so far
  std::vector<bool> taken_;          ///< held or resting; grows with the highest index so far
  std::uint64_t granted_taken_ = 0;  ///< of those, how many are granted
  DueList<Resting> resting_;         ///< void: those that were taken back
  std::unordered_map<std::uint32_t, std::chrono::milliseconds> rests_until_;
  std::uint32_t held_ = 0;
};

}  // namespace gimnet::hub
