#pragma once

#include <cstdint>
#include <optional>
#include <string>

namespace gimnet::hub {

/// Tells who a peer is, as its connection proves it. Two identities are compared as a whole. Thread
/// safety: a value type.
class Identity {
 public:
  /// The peer of a Unix socket about which the kernel says nothing.
  constexpr Identity() = default;
  /// Anybody who reaches a TCP port: all of them are one.
  [[nodiscard]] static constexpr Identity open() { return {Kind::open, 0}; }
  /// A user of this machine, by its user id. The kernel names it at a Unix socket.
  [[nodiscard]] static constexpr Identity of_user(std::uint32_t user) { return {Kind::user, user}; }

  [[nodiscard]] constexpr bool is_user() const { return kind_ == Kind::user; }
  /// Nothing: no user of this machine.
  [[nodiscard]] constexpr std::optional<std::uint32_t> user() const {
    return is_user() ? std::optional{user_} : std::nullopt;
  }
  /// "uid 1000", "open" or "unknown". The MAC of a token covers these bytes (docs/protocol.md,
  /// section 3): other ones would make void each token that was given out before.
  [[nodiscard]] std::string text() const {
    if (kind_ == Kind::user) return "uid " + std::to_string(user_);
    return kind_ == Kind::open ? "open" : "unknown";
  }
  friend constexpr bool operator==(const Identity&, const Identity&) = default;

 private:
  enum class Kind : std::uint8_t { unknown, open, user };
  constexpr Identity(Kind kind, std::uint32_t user) : kind_(kind), user_(user) {}

  Kind kind_ = Kind::unknown;
  std::uint32_t user_ = 0;  ///< 0 unless the kind is `user`
};

/// Rights that not every peer has. A value type.
struct Rights {
  bool administer = false;  ///< change the hub: root and the hub's own user, over a Unix socket
};

}  // namespace gimnet::hub
