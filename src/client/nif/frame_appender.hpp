#pragma once

#include <atomic>
#include <cstddef>
#include <cstdint>
#include <optional>
#include <span>

#include "client/nif/held_messages.hpp"
#include "client/nif/last_messages.hpp"
#include "client/nif/outgoing.hpp"
#include "client/nif/send_queue.hpp"
#include "proto/frame/flow.hpp"
#include "proto/frame/fragmenter.hpp"

namespace gimnet::nif {

/// Bytes that were put into a send queue so far. An urgent frame counts as a whole burst.
/// Thread safety: added to under the lock of the queue, read by any thread.
class AppendedBytes {
 public:
  /// So much of a burst is gathered for one write.
  static constexpr std::size_t kBurst = 64 * 1024;

  void add(std::size_t bytes) {
    // Partner: value(), to whose callers any recent value is good enough.
    bytes_.store(bytes_.load(std::memory_order_relaxed) + bytes, std::memory_order_relaxed);
  }
  void add_urgent() { add(kBurst); }
  /// Some recent value. Partner: add().
  [[nodiscard]] std::uint64_t value() const { return bytes_.load(std::memory_order_relaxed); }

 private:
  std::atomic<std::uint64_t> bytes_{0};
};

/// Makes frames at the end of the send queue, under the id that the node has now. Asks nobody
/// whether there is room. Thread safety: guarded by its owner, but for appended(). Errors:
/// std::bad_alloc, after which the queue is not in order.
class FrameAppender {
 public:
  /// The queue outlives it.
  explicit FrameAppender(SendQueue& queue) : queue_(queue) {}

  /// From now on the node has this id, and its hub takes frames of so many bytes.
  void begin_session(std::uint32_t id, std::uint32_t frame_bytes_max) {
    id_ = id;
    frame_bytes_max_ = frame_bytes_max;
  }
  [[nodiscard]] std::uint32_t id() const { return id_; }
  /// For a message that has a fragment header.
  [[nodiscard]] std::uint32_t next_number() { return next_number_++; }
  /// Any thread.
  [[nodiscard]] const AppendedBytes& appended() const { return appended_; }

  /// A frame of the connection itself (FLOW, LINK, NS, CTRL), before all messages. The source is
  /// filled in.
  void append_control(std::span<const std::byte> frame);
  void append_flow(const proto::flow::Message& message);
  /// A frame of a data kind that the library made. The source is filled in.
  void append_frame(std::span<const std::byte> frame);

  /// Bytes of a frame with this payload.
  [[nodiscard]] static std::size_t frame_size(const Outgoing& message, bool fragment,
                                              std::uint32_t payload) {
    return proto::prefix_size(message.parts()) + (fragment ? proto::kFragmentHeaderSize : 0) +
           payload;
  }
  /// A message in one frame; with its number if it has a fragment header.
  void append_whole(Outgoing& message, std::optional<std::uint32_t> number) {
    std::optional<proto::FragmentHeader> fragment;
    if (number) fragment = proto::FragmentHeader{*number, 0, message.size()};
    put(message, fragment, 0, message.size(), false);
  }
  /// Payload bytes of the largest fragment of the message.
  [[nodiscard]] std::uint32_t piece_max(const Outgoing& message) const;
  /// The next fragment. REQUIRES: the message has a number, the window of `progress` has room, the
  /// fragmenter is not done.
  void append_piece(Outgoing& message, SendProgress& progress, proto::Fragmenter& fragmenter);
  /// A last message again, as a new one and without a request for reports.
  void append_last(const LastMessage& last);
  /// A TAKEN of no message. Its hub reports it if the receiver is gone, which tells a receiver that
  /// crashed from one that is slow.
  void append_probe(std::uint32_t receiver);

 private:
  void put_frame(std::span<std::byte> memory, std::span<const std::byte> frame) const;
  void put(Outgoing& message, std::optional<proto::FragmentHeader> fragment, std::uint32_t offset,
           std::uint32_t size, bool report);
  [[nodiscard]] std::uint32_t room_behind(std::size_t prefix_size) const;
  void put_piece(const LastMessage& last, const proto::FrameParts& parts, std::uint32_t offset);
  [[nodiscard]] std::span<std::byte> memory_for(const proto::FrameHeader& header,
                                                const std::optional<std::uint64_t>& key,
                                                bool replaceable, std::size_t bytes) {
    return replaceable ? queue_.append_latest(header.lane, bytes, latest_stream_of(header, key))
                       : queue_.append(header.lane, bytes);
  }

  SendQueue& queue_;
  std::uint32_t id_ = 0;
  std::uint32_t frame_bytes_max_ = 0;
  std::uint32_t next_number_ = 1;
  AppendedBytes appended_;
};

}  // namespace gimnet::nif
