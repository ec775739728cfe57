#pragma once

#include <cstddef>
#include <cstdint>
#include <vector>

#include "generator/client.hpp"
#include "generator/message_block.hpp"
#include "generator/wire.hpp"

namespace gimnet::perf {

enum class Writing {
  batched,   ///< 64 KiB with a system call, in whole messages
  unbatched  ///< a system call for each message
};

struct MessageShape {
  std::size_t payload_bytes = 16;
  std::uint8_t lane = 1;
};

/// Sends messages of one client to its targets in turns, as fast as it is asked to.
class Publisher {
 public:
  /// REQUIRES: `targets` is not empty; their streams are distinct; Engine::open_publisher(from) was
  /// called.
  Publisher(Wire& wire, Client& from, const std::vector<Target>& targets, MessageShape shape,
            Writing writing);

  /// Begins at most one write. Returns the messages that were begun: 0 when the socket is full, the
  /// subject paused this client, or `messages_max` is less than one write. A write of more than
  /// `cut_to` messages is cut to that.
  std::size_t publish(std::uint64_t messages_max, std::uint64_t cut_to = UINT64_MAX);

  /// Bytes of one message on the wire.
  [[nodiscard]] std::size_t message_bytes() const { return block_.message_bytes(); }
  [[nodiscard]] std::size_t messages_a_write() const { return messages_a_write_; }
  [[nodiscard]] bool is_unbatched() const { return writing_ == Writing::unbatched; }
  [[nodiscard]] Client& client() { return from_; }

 private:
  Client& from_;
  const Writing writing_;
  MessageBlock block_;
  std::size_t messages_a_write_;
  std::size_t next_message_ = 0;  ///< of the block
};

}  // namespace gimnet::perf
