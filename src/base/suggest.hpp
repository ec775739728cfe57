#pragma once

#include <span>
#include <string>
#include <string_view>

namespace gimnet {

/// Letters to insert, delete, exchange or swap with their neighbour to come from `a` to `b`.
[[nodiscard]] std::size_t edit_distance(std::string_view a, std::string_view b);

/// "; did you mean X?" for the candidate nearest to `word`, or "" when none is near (at most a
/// third differs, not counting capitals). Never `word`.
[[nodiscard]] std::string did_you_mean(std::string_view word,
                                       std::span<const std::string_view> candidates);

}  // namespace gimnet
