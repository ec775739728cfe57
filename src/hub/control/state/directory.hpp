#pragma once

#include <chrono>
#include <cstdint>
#include <functional>
#include <map>
#include <optional>
#include <string>
#include <string_view>

#include "hub/control/state/sessions.hpp"

namespace gimnet::hub {

/// Names of nodes: each has one holder. A live holder keeps it against everybody; one within its
/// grace time keeps it against nobody but gets it back if nobody took it. In the order of names,
/// which no choice of names can make slow, and which finds at once all that begin alike. Thread
/// safety: none. Limits: one name a session.
class Directory {
 public:
  using Names = std::map<std::string, NodeIndex, std::less<>>;

  /// The index of the node that holds the name.
  [[nodiscard]] std::optional<NodeIndex> find(std::string_view name) const;

  /// Why `claimant` (nullptr: somebody new) cannot have the name; nothing if it can, perhaps from a
  /// holder who is away and whom the caller then has to end.
  [[nodiscard]] std::optional<proto::Goodbye> refusal(std::string_view name,
                                                      const Session* claimant,
                                                      const Sessions& sessions,
                                                      std::chrono::milliseconds now) const;

  /// REQUIRES: nobody holds the name.
  void put(std::string_view name, NodeIndex index);
  /// Nothing happens for a name that nobody holds, the empty one included.
  void remove(std::string_view name);
  [[nodiscard]] const Names& names() const { return names_; }
  [[nodiscard]] std::size_t size() const { return names_.size(); }

 private:
  Names names_;
};

}  // namespace gimnet::hub
