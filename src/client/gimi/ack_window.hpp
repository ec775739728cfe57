#pragma once

#include <cstddef>
#include <cstdint>
#include <deque>

#include "gimnet/gimi/options.hpp"

namespace gimnet::gimi {

/// The DATA of one stream that wait for their ACK, and when to ask for it with a PING
/// (docs/protocol.md, section 7). Knows no sockets and no clock: it is told the time,
/// steady_now_ns(). Thread safety: one thread at a time. Time alone never frees: an ACK does, and
/// the ACK that belongs to a PONG, and what the caller knows to be lost.
class AckWindow {
 public:
  /// The messages that an event freed.
  struct Freed {
    std::size_t acknowledged = 0;
    std::size_t lost = 0;
    [[nodiscard]] bool any() const { return acknowledged + lost != 0; }
  };

  /// `messages_max` 1..kWindowMax.
  explicit AckWindow(std::size_t messages_max) : messages_max_(messages_max) {}
  /// An ACK with that sequence and bitmap says that this message was taken.
  [[nodiscard]] static bool says_taken(std::uint32_t highest, std::uint64_t bitmap,
                                       std::uint32_t sequence);

  /// For a message of so many bytes. A message always has room where no other waits, whatever its
  /// size.
  [[nodiscard]] bool has_room(std::size_t bytes) const;
  [[nodiscard]] std::size_t size() const { return waiting_.size(); }
  [[nodiscard]] bool empty() const { return waiting_.empty(); }

  /// The sequence of the next DATA, which waits from now on. REQUIRES: has_room() for it.
  std::uint32_t open(std::size_t bytes, std::int64_t now_ns);
  /// The sequence of the next DATA, for whose ACK nobody waits.
  std::uint32_t pass() { return next_sequence_++; }
  /// That DATA waits for its ACK.
  [[nodiscard]] bool waits_for(std::uint32_t sequence) const;
  /// The DATA of the last open() was not sent. False: it did not wait any more.
  bool cancel(std::uint32_t sequence);

  /// `pong` is the PING that the ACK belongs to, or 0.
  Freed acknowledge(std::uint32_t highest, std::uint64_t bitmap, std::uint32_t pong,
                    std::int64_t now_ns);
  Freed lose(std::uint32_t sequence);
  Freed lose_all();

  /// A PING should stand behind what waits, now. It stays due until ping_sent().
  [[nodiscard]] bool ping_due(std::int64_t now_ns) const;
  /// The number of the PING that is open already, to be repeated; 0: none.
  [[nodiscard]] std::uint32_t ping_number() const { return ping_number_; }
  void ping_sent(std::uint32_t number, std::int64_t now_ns);
  /// That PING could not be sent: it is due again.
  void ping_not_sent();
  /// Ask at the next occasion: something says that messages were lost.
  void hurry() { hurried_ = true; }

  [[nodiscard]] std::int64_t round_trip_ns() const { return round_trip_ns_; }

 private:
  struct Waiting {
    std::uint32_t sequence;
    bool acknowledged;
    std::size_t bytes;
    std::int64_t sent_ns;
  };
  /// It does not count any more.
  void free(Waiting& waiting);
  [[nodiscard]] std::int64_t patience_ns() const;
  void drop_front();

  std::size_t messages_max_;
  /// Ascending; acknowledged ones only behind one that is not. Limit: messages_max_
  std::deque<Waiting> waiting_;
  std::size_t unacknowledged_ = 0;
  std::size_t unacknowledged_bytes_ = 0;
  std::uint32_t next_sequence_ = 1;
  std::uint32_t ping_number_ = 0;
  std::uint32_t ping_covers_ = 0;  ///< the last DATA before the open PING
  std::int64_t ping_again_ns_ = 0;
  std::uint32_t pings_ = 0;  ///< how often the open PING was sent
  std::int64_t round_trip_ns_ = 0;
  bool hurried_ = false;
};

}  // namespace gimnet::gimi
