#pragma once

#include <chrono>
#include <cstdint>
#include <functional>
#include <optional>
#include <string>
#include <string_view>
#include <unordered_map>

#include "hub/control/state/sessions.hpp"

namespace gimnet::hub {

/// Names of nodes: each has one holder. A live holder keeps it against everybody; one within its grace time keeps it
/// against nobody but gets it back if nobody took it. Thread safety: none. Limits: one name a session.
class Directory {
 public:
  /// The index of the node that holds the name.
  [[nodiscard]] std::optional<std::uint32_t> find(std::string_view name) const;

  /// Why `claimant` (nullptr: somebody new) cannot have the name; nothing if it can, perhaps from a holder who is away
  /// and whom the caller then has to end.
  [[nodiscard]] std::optional<Refusal> refusal(std::string_view name, const Session* claimant, const Sessions& sessions,
                                               std::chrono::milliseconds now) const;

  /// REQUIRES: nobody holds the name.
  void put(std::string_view name, std::uint32_t index);
  /// Nothing happens for a name that nobody holds, the empty one included.
  void remove(std::string_view name);
  [[nodiscard]] std::size_t size() const { return holders_.size(); }

 private:
  struct Hash {
    using is_transparent = void;
    std::size_t operator()(std::string_view text) const { return std::hash<std::string_view>{}(text); }
  };
  std::unordered_map<std::string, std::uint32_t, Hash, std::equal_to<>> holders_;
};

}  // namespace gimnet::hub
