#pragma once

#include <cstddef>
#include <cstdint>
#include <list>
#include <optional>
#include <span>
#include <unordered_map>
#include <vector>

#include "base/byte_buffer.hpp"
#include "base/ids.hpp"
#include "proto/frame/fragment_header.hpp"
#include "proto/frame/fragment_stream.hpp"
#include "proto/frame/fragmenter.hpp"
#include "proto/frame/frame_header.hpp"

// Puts a receiver's messages together again (docs/protocol.md, section 6).

namespace gimnet::proto {

/// Memory is bounded by these numbers, never by what a fragment claims.
struct ReassemblyLimits {
  std::uint32_t message_bytes_max = 64u << 20;  ///< of one message; at most kMessageBytesMax
  std::uint64_t waiting_bytes_max = 256ull
                                    << 20;  ///< received bytes of all unfinished messages together
  std::uint32_t streams_max = 256;  ///< streams that are remembered, each with at most one message
};

/// The result of one fragment.
struct Reassembled {
  enum class State : std::uint8_t {
    part,       ///< taken; more is to come
    whole,      ///< taken; the message is in `message`
    too_large,  ///< discarded: the message is over message_bytes_max (tell a UNICAST sender with a
                ///< refusing TAKEN)
    lost,  ///< discarded: the fragment does not follow what was received, or belongs to a message
           ///< lost before
    no_memory,  ///< discarded: there is no room for it beside what its source has, or no memory
  };
  State state = State::part;
  std::uint32_t lost_messages =
      0;  ///< messages of this stream that ended as lost by this call, this one or one before it
  /// Sources of messages that were lost to make room for this one, a source for each message.
  std::vector<std::uint32_t> displaced{};
  std::uint32_t taken = 0;  ///< bytes of this message received so far
  /// The whole message: in `storage`, or, where it came in one fragment, in the caller's bytes.
  std::span<const std::byte> message;
  ByteBuffer storage;
};

/// Takes the fragments of any number of streams. A message that is cut short by the rules, by a
/// limit or by forget() is lost as a whole and counted once; nothing incomplete is ever given out.
/// Thread safety: one thread. Ownership: bytes of unfinished messages. Cost: O(1) a fragment beside
/// copying its bytes; a message's memory grows as its bytes come, at most to twice of what was
/// received.
class Reassembler {
 public:
  /// REQUIRES: message_bytes_max <= kMessageBytesMax and <= waiting_bytes_max, streams_max >= 1.
  explicit Reassembler(const ReassemblyLimits& limits = {});

  /// If a limit is reached, the source that holds most of the room loses the message that waited
  /// longest for its next fragment.
  /// REQUIRES: the fragment fits its own total, as parse_frame() checks.
  /// `memory`: of a first fragment, an empty buffer for the message.
  [[nodiscard]] Reassembled take(const FragmentStream& stream, const FragmentHeader& fragment,
                                 std::span<const std::byte> payload, ByteBuffer memory = {});

  /// An unfragmented message came in the stream: an unfinished one before it is lost. Returns
  /// messages lost, 0 or 1.
  std::uint32_t interrupt(const FragmentStream& stream);

  /// The node is gone: its unfinished messages are lost. Returns how many.
  std::uint32_t forget(NodeId src);
  /// The connection is new: everything unfinished is lost. Returns how many messages.
  std::uint32_t clear();

  /// Progress of one stream.
  struct Standing {
    FragmentStream stream;
    std::optional<FragmentHeader> open;  ///< the unfinished message; `offset`: bytes taken so far
    std::optional<std::uint32_t> lost;   ///< the number of the message that was lost last
  };
  /// Of all streams of that node; of nobody: of all nodes.
  [[nodiscard]] std::vector<Standing> standings(std::optional<NodeId> src) const;

  [[nodiscard]] std::uint64_t waiting_bytes() const { return waiting_bytes_; }
  [[nodiscard]] std::size_t open_messages() const { return open_messages_; }
  /// Messages lost since construction.
  [[nodiscard]] std::uint64_t lost_messages() const { return lost_messages_; }

 private:
  struct StreamHash {
    std::size_t operator()(const FragmentStream& stream) const noexcept;
  };
  /// A stream's unfinished message, or the last one that was lost, whose other fragments are not
  /// counted again.
  struct Entry {
    FragmentStream stream;
    bool open = false;
    bool has_lost = false;
    std::uint32_t message = 0;
    std::uint32_t lost_message = 0;
    std::uint32_t total = 0;
    ByteBuffer bytes;
  };
  using Entries = std::list<Entry>;  ///< the one that waited longest is first. Limit: streams_max

  Entry& touch(const FragmentStream& stream);
  void remember_lost(Entry& entry, std::uint32_t message);
  void close(Entry& entry);
  void lose(Entry& entry);
  /// The one that waited longest of the source with the largest sum of amounts.
  template <class AmountOf>
  [[nodiscard]] Entries::iterator fullest(AmountOf amount_of);
  void displace(Entry& entry);
  bool make_room(const Entry& keep, std::size_t bytes);
  Reassembled begin(Entry& entry, const FragmentHeader& fragment,
                    std::span<const std::byte> payload, ByteBuffer memory);
  Reassembled append(Entry& entry, std::span<const std::byte> payload);
  Reassembled refuse(Entry& entry, std::uint32_t message, Reassembled::State state);

  const ReassemblyLimits limits_;

  Entries entries_;
  std::unordered_map<FragmentStream, Entries::iterator, StreamHash> by_stream_;
  std::uint64_t waiting_bytes_ = 0;
  std::size_t open_messages_ = 0;
  std::uint64_t lost_messages_ = 0;
  std::vector<std::uint32_t> displaced_;  ///< by the take() that is under way
};

}  // namespace gimnet::proto
