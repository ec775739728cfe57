#pragma once

#include <cstddef>
#include <cstdint>
#include <map>
#include <span>
#include <string>
#include <vector>

#include "base/ids.hpp"
#include "proto/frame/frame_header.hpp"
#include "tests/sim/hubs/checker.hpp"

namespace gimnet::sim::hubs {

/// One direction of a link between two hubs, by their places in the plan.
struct Crossing {
  std::size_t wire = 0;
  std::size_t from = 0;
  std::size_t to = 0;
  friend bool operator==(const Crossing&, const Crossing&) = default;
};

/// The holder of each id, and the way of each frame that a node sent to one other node. Thread
/// safety: none. Errors: what must not be stops the world.
class Book {
 public:
  /// The payload begins with the frame's number.
  static constexpr std::size_t kNumberBytes = 8;

  // Identities

  /// A session begins, or goes on, at that hub, under that id. Returns its number.
  std::uint64_t note_session(std::size_t hub, NodeId node, bool is_new);
  /// 0: nobody knows, since nobody had the id, or two hubs have given it out.
  [[nodiscard]] std::uint64_t session_of(NodeId node) const;
  [[nodiscard]] const std::vector<NodeId>& known() const { return known_; }
  /// A service that takes data is offered by that session.
  void note_group(GroupId group, std::uint64_t session) { groups_[group] = session; }
  [[nodiscard]] const std::map<GroupId, std::uint64_t>& groups() const { return groups_; }

  // Frames

  /// A node of that hub sends a frame to that session, 0: to whoever it may be. Returns its number.
  std::uint64_t note_sent(std::size_t hub, std::uint64_t session);
  /// A frame is written to a link.
  void note_crossing(const Crossing& crossing, const proto::FrameHeader& header,
                     std::span<const std::byte> payload);
  /// It came to a node with that session.
  void note_arrived(std::span<const std::byte> payload, std::uint64_t session);
  [[nodiscard]] bool has_arrived(std::uint64_t number) const { return letters_[number].arrived; }
  [[nodiscard]] std::uint64_t sent() const { return letters_.size(); }
  [[nodiscard]] std::uint64_t arrived() const { return arrived_; }

 private:
  struct Holder {
    std::uint64_t session = 0;
    std::size_t hub = 0;
    bool ambiguous = false;
  };
  struct Letter {
    std::uint64_t session = 0;  ///< that it is for
    std::size_t origin = 0;
    Crossing last;  ///< valid if links != 0
    std::uint32_t links = 0;
    bool arrived = false;
  };
  /// Null: no frame of this book.
  [[nodiscard]] Letter* find(std::span<const std::byte> payload);

  std::map<NodeId, Holder> holders_;
  std::vector<NodeId> known_;
  std::map<GroupId, std::uint64_t> groups_;
  std::vector<Letter> letters_;
  std::uint64_t last_session_ = 0;
  std::uint64_t arrived_ = 0;
};

}  // namespace gimnet::sim::hubs
