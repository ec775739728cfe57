#pragma once

#include <charconv>
#include <cstdint>
#include <optional>
#include <string>
#include <string_view>

#include "base/ids.hpp"

// Ids as people read them, node `7.17`, group `7#17`, and as they type those of nodes.
// Thread safety: pure functions.

namespace gimnet {
namespace detail {

template <class Id>
[[nodiscard]] std::string id_text(Id id, char separator) {
  return std::to_string(hub_of(id).value()) + separator + std::to_string(index_of(id));
}

/// Decimal digits only, at most `max`.
[[nodiscard]] inline std::optional<std::uint32_t> parse_number(std::string_view text,
                                                               std::uint32_t max) {
  std::uint32_t number = 0;
  const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), number);
  if (error != std::errc() || end != text.data() + text.size() || number > max) return std::nullopt;
  return number;
}

}  // namespace detail

[[nodiscard]] inline std::string to_string(NodeId id) { return detail::id_text(id, '.'); }
[[nodiscard]] inline std::string to_string(GroupId id) { return detail::id_text(id, '#'); }

/// Nothing: not `HUB.INDEX` in decimal, or a part is out of range.
[[nodiscard]] inline std::optional<NodeId> parse_node_id(std::string_view text) {
  const auto middle = text.find('.');
  if (middle == std::string_view::npos) return std::nullopt;
  const auto hub = detail::parse_number(text.substr(0, middle), kEveryHub.value());
  const auto index = detail::parse_number(text.substr(middle + 1), kIndexMask);
  if (!hub || !index) return std::nullopt;
  return make_id<NodeId>(HubId{static_cast<std::uint16_t>(*hub)}, *index);
}

}  // namespace gimnet
