#pragma once

#include <cstdint>
#include <vector>

#include "hub/data/egress/entry.hpp"
#include "proto/frame/fragment_stream.hpp"

namespace gimnet::hub {

/// The messages in fragments of which one connection took the beginning, and the end has not come.
/// Thread safety: one shard. Limits: 256 messages. Beyond it the source with most of them loses the
/// oldest: a sender that never ends its messages takes no place of others.
class OpenMessages {
 public:
  static constexpr std::size_t kMost = 256;

  /// Takes note of where a fragment stands in its message. Returns whether it may go on: no rest of
  /// a message of which the beginning did not come or was dropped. REQUIRES: it was not joined to
  /// others yet.
  [[nodiscard]] bool follow(const Entry& fragment);
  /// The message that these fragments are of was dropped: its rest may not go on.
  void forget(const Entry& fragments);
  [[nodiscard]] bool empty() const { return messages_.empty(); }
  void clear() { messages_.clear(); }

 private:
  struct Message {
    proto::FragmentStream stream;
    std::uint32_t number = 0;
  };
  [[nodiscard]] std::vector<Message>::iterator find(const proto::FragmentStream& stream);
  void add(const Message& message);

  std::vector<Message> messages_;  ///< one of a stream, the oldest first
};

}  // namespace gimnet::hub
