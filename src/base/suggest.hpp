#pragma once

#include <cstdint>
#include <functional>
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

/// The word that may follow the name of an option.
enum class Takes : std::uint8_t {
  unknown,  ///< there is no such option
  nothing,  ///< `--NAME` alone
  boolean,  ///< `--NAME` alone, or `--NAME=true` or `--NAME=false`
  value,    ///< `--NAME VALUE` or `--NAME=VALUE`
};

/// Why a command line cannot be: the first word `--NAME=VALUE` whose value its option does not
/// take, or `--NAME` whose value would be what reads as another option (begins with `--`, or is
/// one); "": there is none. The library that reads command lines takes `--FLAG=` and `--FLAG=2` for
/// true, and for `--NAME=` (of a shell variable that is not set, say) and `--NAME` the next word,
/// whatever it is. What follows `--` is not looked at. Thread safety: that of `takes`.
[[nodiscard]] std::string wrong_option_word(std::span<const char* const> words,
                                            const std::function<Takes(std::string_view)>& takes);

}  // namespace gimnet
