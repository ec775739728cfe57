#pragma once

#include <array>
#include <cstdint>
#include <vector>

#include "hub/data/egress/egress_context.hpp"

namespace gimnet::hub {

/// The senders that one outbox told to pause, and for what. Each is told again now and then if it
/// goes on sending, held (not read) once it used up the reserve, and told to resume when there is
/// room. Thread safety: one shard.
class PauseBook {
 public:
  [[nodiscard]] bool empty() const { return notes_.empty(); }
  [[nodiscard]] std::size_t size() const { return notes_.size(); }

  /// The bytes with BLOCK that are beyond a limit, and how many may be before senders are held. All
  /// that the outbox holds, and up to how much it takes of senders of other hubs, which cannot be.
  struct Excess {
    std::uint64_t bytes = 0;
    std::uint64_t reserve = 0;
    std::uint64_t held = 0;
    std::uint64_t held_most = 0;
  };
  /// A frame with BLOCK came although its lane is full: asks its sender to pause. Returns false if
  /// it came all the same, although it was held: the frame is not to be taken.
  [[nodiscard]] bool ask(const proto::FrameHeader& header, std::uint32_t bytes,
                         const Excess& excess, EgressContext& context);
  /// A frame with BLOCK of `bytes` came although its lane is full. Returns the bytes that came from
  /// its sender for that target since it was held, this frame included; 0: it is not held.
  std::uint64_t on_full(NodeId sender, const proto::flow::Target& target, std::uint32_t bytes,
                        bool past_reserve, SenderSignals& signals);
  /// The lane has room again for the senders at those places of SourceBytes.
  void on_room(proto::Lane lane, std::uint32_t places, SenderSignals& signals);
  /// Is anybody paused for that lane?
  [[nodiscard]] bool pauses(std::size_t lane) const { return places_[lane] != 0; }
  /// Repeats each PAUSE about another hub than the sender's, which the sender heeds for a second.
  void say_again(SenderSignals& signals) const;
  /// The outbox is given up.
  void release_all(SenderSignals& signals);

 private:
  struct Note {
    NodeId sender;
    proto::flow::Target target;
    std::uint32_t bytes_since = 0;  ///< it was told last
    std::uint64_t held_bytes = 0;   ///< that came since it was held
    bool held = false;
  };
  /// A sender that still sends after so many bytes has not seen PAUSE, or lost it with a
  /// connection: told again.
  static constexpr std::uint32_t kRemindBytes = 256 * 1024;

  /// A sender that is held may still be read, because its own CONFIRM is waited for, and it may
  /// ignore PAUSE. Beyond so many reserves its messages are dropped, with or without BLOCK.
  static constexpr std::uint64_t kReservesMax = 8;
  /// Senders of other hubs that one outbox pauses. More of them are dropped once the reserves are
  /// used up.
  static constexpr std::size_t kPausedAfarMost = 4'096;

  static void let_go(Note& note, SenderSignals& signals);

  std::vector<Note> notes_;
  std::array<std::uint32_t, proto::kLaneCount> places_{};  ///< of those paused for each lane
};

}  // namespace gimnet::hub
