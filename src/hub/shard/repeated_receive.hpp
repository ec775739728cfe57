#pragma once

#include <algorithm>
#include <cstddef>
#include <span>

#include "hub/data/tally.hpp"
#include "hub/shard/connection.hpp"

namespace gimnet::hub {

/// From this size on a read is worth its system call.
inline constexpr std::size_t kSmallReadBytes = 16 * 1024;
/// So often more is read behind a small read.
inline constexpr int kReadsMore = 4;

/// Reads what follows into the rest of the room. An end or an error shows again at the next read.
[[nodiscard]] std::size_t receive_more(Connection& connection, std::span<std::byte> room,
                                       Tally& tally);

/// Reads, and after a small read reads again if that often finds more. A sender that writes message
/// by message has written the next one while the first was read. Both then leave in one write, and
/// a message costs mostly its write (docs/why-these-figures.md). REQUIRES: `room` is not empty.
/// Thread safety: one shard.
[[nodiscard]] inline net::IoResult receive_repeatedly(Connection& connection,
                                                      std::span<std::byte> room, Tally& tally) {
  net::IoResult result = connection.transport->receive(room);
  ++tally.receive_calls;
  if (result.status == net::IoStatus::ok && result.bytes < std::min(kSmallReadBytes, room.size()) &&
      connection.read_again.is_due()) {
    result.bytes += receive_more(connection, room.subspan(result.bytes), tally);
  }
  return result;
}

}  // namespace gimnet::hub
