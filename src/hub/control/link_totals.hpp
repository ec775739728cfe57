#pragma once

#include <cstdint>
#include <map>

#include "hub/network/state/own_record.hpp"
#include "hub/observe/session_gauges.hpp"

namespace gimnet::hub {

/// The counts of links, as far as sessions of them have ended. A link counts over all its sessions.
/// Its two ends do so under one number: when a connection begins, both go on under the number that
/// they have, or both begin anew under another one (docs/protocol.md, section 10). Thread safety:
/// the conductor's thread only. Limits: one entry for each link and each session on its way out.
class LinkTotals {
 public:
  /// 0: that link has not counted yet.
  [[nodiscard]] std::uint64_t number_of(LinkNumber link) const {
    const auto found = totals_.find(link);
    return found == totals_.end() ? 0 : found->second.number;
  }
  /// A connection of the link begins, whose ends agreed on that number; 0: they did not. Returns
  /// whether the link counts anew, from 0.
  [[nodiscard]] bool count_under(LinkNumber link, std::uint64_t number) {
    if (number != 0 && number == number_of(link)) return false;
    forget(link);
    totals_[link].number = number;
    return true;
  }
  /// A session of that link was told to end: its counts will come.
  void release(LinkNumber link, std::uint32_t generation) { ending_[generation] = link; }
  /// The counts of a session that ended. Nothing happens if its link counted anew meanwhile.
  void add(std::uint32_t generation, const SessionCounts& counts) {
    const auto found = ending_.find(generation);
    if (found == ending_.end()) return;
    totals_[found->second].ended += counts;
    ending_.erase(found);
  }
  [[nodiscard]] SessionCounts of(LinkNumber link) const {
    const auto found = totals_.find(link);
    return found == totals_.end() ? SessionCounts{} : found->second.ended;
  }
  void forget(LinkNumber link) {
    totals_.erase(link);
    std::erase_if(ending_, [link](const auto& each) { return each.second == link; });
  }

 private:
  struct Total {
    std::uint64_t number = 0;
    SessionCounts ended;
  };
  std::map<LinkNumber, Total> totals_;
  std::map<std::uint32_t, LinkNumber> ending_;  ///< by generation
};

}  // namespace gimnet::hub
