#pragma once

#include <chrono>
#include <cstddef>
#include <cstdint>
#include <optional>
#include <span>
#include <string>
#include <unordered_map>
#include <vector>

#include "hub/control/state/due_list.hpp"
#include "hub/limits.hpp"

namespace gimnet::hub {

/// A set of indices of nodes or groups. A value type. Limits: one bit for each index up to the
/// highest so far.
class IndexSet {
 public:
  [[nodiscard]] bool contains(std::uint32_t index) const {
    return index / 8 < bytes_.size() && (bytes_[index / 8] & bit(index)) != std::byte{0};
  }
  void insert(std::uint32_t index);
  void erase(std::uint32_t index);
  [[nodiscard]] std::uint32_t size() const { return size_; }

  /// Index i is bit i % 8 of byte i / 8, and the last byte is not 0. Valid until: the set changes.
  [[nodiscard]] std::span<const std::byte> bytes() const;
  /// Reads what bytes() gave, of indices from 1 to `most`; nothing for any other bytes.
  [[nodiscard]] static std::optional<IndexSet> from_bytes(std::span<const std::byte> bytes,
                                                          std::uint32_t most);
  /// The longest that bytes() can be for indices up to `most`.
  [[nodiscard]] static constexpr std::size_t bytes_max(std::uint32_t most) { return most / 8 + 1; }

  friend bool operator==(const IndexSet& a, const IndexSet& b);

 private:
  [[nodiscard]] static constexpr std::byte bit(std::uint32_t index) {
    return std::byte{1} << (index % 8);
  }

  std::vector<std::byte> bytes_;
  std::uint32_t size_ = 0;
};

/// The time for which an index rests: until no frame to its former holder can wait in this hub.
[[nodiscard]] std::chrono::milliseconds index_resting_time(const Limits& limits);

/// From where a pool hands out indices to newcomers: `count` of them from `first` on, cyclically,
/// without those that were used before a restart and wait for who comes back.
struct IndexRange {
  std::uint32_t first = 1;
  std::uint64_t count = kAll;
  IndexSet used{};
  /// Of a pool of which nothing outlives the hub.
  static constexpr std::uint64_t kAll = std::uint64_t{1} << 62;
};

/// Hands out indices 1..most cyclically, none twice before the others are used up. An index that
/// was given back rests before it can come again, so that frames still under way to its former
/// holder never reach a stranger.
///
/// What a newcomer may get outlives the hub before anybody gets it: some indices are granted ahead,
/// and kept as used. A later start that goes on from what was kept gives newcomers none that
/// anybody may have. Used indices that nobody has any more are forgotten when few others are left,
/// but never while nodes of before a restart may still come back. Thread safety: none. Limits:
/// `most` indices; two bits each. It serves nodes and groups alike: its indices get their type
/// (NodeIndex, GroupIndex) where they leave it.
class IndexPool {
 public:
  /// So many indices are granted at a time.
  static constexpr std::uint32_t kBlock = 4'096;

  /// REQUIRES: 0 < range.first <= most. Until `returns_until` those of before a restart may come
  /// back.
  IndexPool(std::uint32_t most, std::chrono::milliseconds resting_time,
            const IndexRange& range = {}, std::chrono::milliseconds returns_until = {});

  /// Has take() one to give?
  [[nodiscard]] bool ready(std::chrono::milliseconds now);
  /// The next index that is granted and not used; nothing if there is none.
  [[nodiscard]] std::optional<std::uint32_t> take(std::chrono::milliseconds now);
  /// That index, granted or not, if nobody holds it and it does not rest.
  [[nodiscard]] bool take_free(std::uint32_t index, std::chrono::milliseconds now);
  /// Nobody was told of that index, which take_free() gave: it need not rest, but stays used.
  /// REQUIRES: it is held.
  void let_go(std::uint32_t index);
  /// That index, if nobody holds it: for its former holder, for whom it need not rest.
  [[nodiscard]] bool take_back(std::uint32_t index);
  /// REQUIRES: the index is held.
  void give_back(std::uint32_t index, std::chrono::milliseconds now);
  [[nodiscard]] bool held(std::uint32_t index) const;
  [[nodiscard]] std::uint32_t held() const { return held_; }
  /// Was it handed out, or may it have been before a restart, and was not forgotten since?
  [[nodiscard]] bool used(std::uint32_t index) const { return used_.contains(index); }
  /// Those of before a restart may come back for so much longer, at the latest until `latest`.
  void put_off_returns(std::chrono::milliseconds by, std::chrono::milliseconds latest);
  /// Are there used ones that were not kept as used yet? A start that goes on from what was kept
  /// could hand them out.
  [[nodiscard]] bool unkept() const { return unkept_ && !keeps_nothing_; }
  /// The time that newcomers have to wait for nodes of before a restart, since all indices are
  /// used; nothing: that is not the reason.
  [[nodiscard]] std::optional<std::chrono::milliseconds> waits_for_returns(
      std::chrono::milliseconds now) const;

  /// Would there be one to give, if next_grant() could be kept?
  [[nodiscard]] bool waits_for_keeping(std::chrono::milliseconds now) const;
  /// Why nobody can be given an index now, as a sentence; `kind` names them ("node ids").
  [[nodiscard]] std::string shortage(const std::string& kind, std::chrono::milliseconds now) const;

  /// The indices to be kept where they outlive the hub, and those that may be handed out then.
  struct Grant {
    IndexSet used;            ///< what the next start must not hand out
    std::uint32_t mark = 1;   ///< from which it begins
    std::uint64_t count = 0;  ///< how many indices may be looked at from the pool's first on
    bool forgets_gone =
        false;  ///< used indices that nobody holds and that do not rest may be handed out anew
  };
  /// Is there reason to keep next_grant()? Less than half a block of what was granted is left, or
  /// somebody has an index that was not kept as used, or used ones are due to be forgotten; and it
  /// helps.
  [[nodiscard]] bool keeping_due(std::chrono::milliseconds now) const;
  [[nodiscard]] Grant next_grant(std::chrono::milliseconds now) const;
  /// That was kept. REQUIRES: next_grant() answered it, and nothing was asked of the pool since.
  void grant(const Grant& grant);
  /// That could not be kept.
  void keeping_failed() { keeping_failed_ = true; }

 private:
  struct Resting {
    std::chrono::milliseconds until;
    std::uint32_t index;
  };
  [[nodiscard]] std::uint32_t index_at(std::uint64_t position) const;
  [[nodiscard]] bool granted(std::uint32_t index) const;
  [[nodiscard]] bool still_rests(const Resting& note) const;
  [[nodiscard]] bool forgetting_due(std::chrono::milliseconds now) const;
  [[nodiscard]] std::uint32_t unused() const { return most_ - used_.size(); }
  void hold(std::uint32_t index);
  void wake(std::chrono::milliseconds now);

  const std::uint32_t most_;
  const std::chrono::milliseconds resting_time_;
  const std::uint32_t first_;
  const bool keeps_nothing_;
  std::chrono::milliseconds returns_until_;
  std::uint64_t position_ = 0;  ///< of the one to look at next; index_at() tells which that is
  std::uint64_t
      end_;  ///< granted are the positions from there to here, no more than there are indices
  std::uint32_t granted_left_ = 0;  ///< of those, how many are not used
  IndexSet taken_;                  ///< held or resting
  IndexSet used_;                   ///< the same, and what was or may have been
  bool keeping_failed_ = false;     ///< the last time that it was tried
  bool unkept_ = false;             ///< something used was neither granted nor kept as used
  DueList<Resting> resting_;        ///< void: those that were taken back
  std::unordered_map<std::uint32_t, std::chrono::milliseconds> rests_until_;
  std::uint32_t held_ = 0;
};

}  // namespace gimnet::hub
