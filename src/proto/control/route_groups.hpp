#pragma once

#include <cstddef>
#include <cstdint>
#include <vector>

#include "base/ids.hpp"
#include "proto/control/route.hpp"

// The messages of ROUTE frames by which a hub asks a neighbour for the messages of groups
// (docs/protocol.md, section 10, "Groups"). Thread safety: value types.

namespace gimnet::proto::route {

/// Groups in one JOIN or LEAVE.
inline constexpr std::size_t kGroupsMax = 512;

/// The terms of a hub for a group, on behalf of all subscribers behind it.
struct JoinTerms {
  std::uint32_t interval_us = 0;  ///< between two messages at least; 0: none
  std::uint16_t depth = 1;        ///< newest messages that are held for it
  std::uint16_t window = 0;       ///< messages that may wait for the link; 0: any number
  friend bool operator==(const JoinTerms&, const JoinTerms&) = default;
};

/// The neighbour is to send the messages of these groups over this link.
struct Join {
  static constexpr std::uint16_t kOperation = static_cast<std::uint16_t>(RouteOperation::join);
  static constexpr const char* kName = "JOIN";
  struct Entry {
    GroupId group;
    JoinTerms terms;
    std::uint32_t subscribers = 1;  ///< at the sender and behind it, at least 1
    friend bool operator==(const Entry&, const Entry&) = default;
  };
  std::vector<Entry> groups;  ///< 1 to kGroupsMax
  bool anew = false;          ///< it begins with the last message of those that are retained
  void write(bitestream::Writer& writer) const;
  [[nodiscard]] static Join read(Fields& fields);
  friend bool operator==(const Join&, const Join&) = default;
};

/// It is to send their messages no more.
struct Leave {
  static constexpr std::uint16_t kOperation = static_cast<std::uint16_t>(RouteOperation::leave);
  static constexpr const char* kName = "LEAVE";
  std::vector<GroupId> groups;  ///< 1 to kGroupsMax
  void write(bitestream::Writer& writer) const;
  [[nodiscard]] static Leave read(Fields& fields);
  friend bool operator==(const Leave&, const Leave&) = default;
};

/// All groups that the sender had joined when the connection began have been named.
struct JoinsEnd {
  static constexpr std::uint16_t kOperation = static_cast<std::uint16_t>(RouteOperation::joins_end);
  static constexpr const char* kName = "JOINS_END";
  void write(bitestream::Writer&) const {}
  [[nodiscard]] static JoinsEnd read(Fields&) { return {}; }
  friend bool operator==(const JoinsEnd&, const JoinsEnd&) = default;
};

/// From now on the messages of these groups come over this link: the answer to JOIN.
struct Joined {
  static constexpr std::uint16_t kOperation = static_cast<std::uint16_t>(RouteOperation::joined);
  static constexpr const char* kName = "JOINED";
  std::vector<GroupId> groups;  ///< 1 to kGroupsMax
  void write(bitestream::Writer& writer) const;
  [[nodiscard]] static Joined read(Fields& fields);
  friend bool operator==(const Joined&, const Joined&) = default;
};

}  // namespace gimnet::proto::route
