#pragma once

#include <cstdint>

#include "base/ids.hpp"
#include "hub/data/egress/entry.hpp"

namespace gimnet::hub {

/// The groups of which a recipient takes only so many messages at a time, as its queues see them. A
/// message counts with the frame that ends it. Thread safety: one shard.
class CountedGroups {
 public:
  /// Are this group's messages counted? Then a written one is kept until it is confirmed: it is
  /// never let go.
  [[nodiscard]] virtual bool counts(GroupId group) const = 0;
  /// So many messages of the group that were on their way to the recipient do not reach it.
  virtual void on_lost(GroupId group, std::uint32_t messages) = 0;
  /// The messages that these were of do not reach it.
  void on_entry_lost(const Entry& entry);
  void on_run_lost(const Run& run);
  /// As on_run_lost(), with the header that all its frames have.
  void on_run_lost(const Run& run, const proto::FrameHeader& header);

 protected:
  ~CountedGroups() = default;
};

}  // namespace gimnet::hub
