#pragma once

#include <array>
#include <chrono>
#include <cstddef>
#include <cstdint>
#include <functional>
#include <span>
#include <vector>

#include "base/ids.hpp"
#include "base/result.hpp"
#include "hub/control/state/index_pool.hpp"
#include "hub/control/state/session_token.hpp"

// The state that a hub keeps over its restarts, and the bytes of the file that it is kept in
// (docs/operations.md, "State"). Thread safety: value types and pure functions.

namespace gimnet::hub {

struct HubState {
  Secret secret{};                        ///< proves tokens
  std::array<std::byte, 16> unique_id{};  ///< random, of this hub alone
  std::uint64_t boot = 0;                 ///< counts the starts, from 1
  std::uint32_t node_mark = 1;            ///< the next start hands out node indices from here
  std::uint32_t group_mark = 1;           ///< the same for groups
  HubId drawn_hub;                        ///< that the hub drew, having none configured; 0: none
  IndexSet nodes_used;                    ///< node indices that the next start must not hand out
  std::vector<SessionToken> kicked;       ///< not honoured any more
  friend bool operator==(const HubState&, const HubState&) = default;
};

inline constexpr std::size_t kKickedMax = 65'536;
/// The longest legal file.
inline constexpr std::size_t kHubStateBytesMax =
    88 + kKickedMax * 24 + IndexSet::bytes_max(kIndexMost) + 32;

[[nodiscard]] std::vector<std::byte> write_hub_state(const HubState& state);
/// The file is not trusted: whatever it holds is read as written above or refused. Errors: what is
/// wrong with it, as the end of a sentence about the file.
[[nodiscard]] Result<HubState> read_hub_state(std::span<const std::byte> bytes);

/// Hub ids below are left to those who configure them.
inline constexpr std::uint16_t kDrawnHubMin = 1024;

/// A hub id that is not taken, from kDrawnHubMin on, chosen by `random`. 0: all are taken.
[[nodiscard]] HubId draw_hub(std::uint64_t random, const std::function<bool(HubId)>& taken);

/// A start of the hub: what has to be kept before it begins, and what newcomers may be given.
struct HubStart {
  HubState state;
  IndexRange nodes{};
  IndexRange groups{};
};
/// Goes on from the state that was found: the next boot number, unused node indices from the mark
/// on, all of them kept as used, and the next block of group indices. Kicked nodes whose tokens
/// have expired by `wall` (since 1970) are forgotten. Errors: the boot number is at its end.
[[nodiscard]] Result<HubStart> next_start(const HubState& found, std::chrono::milliseconds wall);

/// Never 0, and another one at each start, also of a hub that keeps nothing.
[[nodiscard]] std::uint64_t epoch_of(const HubStart& start);

}  // namespace gimnet::hub
