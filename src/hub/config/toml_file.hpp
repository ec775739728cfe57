#pragma once

#include <cstddef>
#include <string>
#include <string_view>
#include <vector>

#include "hub/config/value.hpp"

namespace gimnet::hub {

/// Most bytes of one configuration file.
inline constexpr std::size_t kConfigBytesMax = std::size_t{1} << 20;
/// Most faults that are told at once: more than one file can have, which is one for every two of
/// its bytes.
inline constexpr std::size_t kConfigFaultsMax = 1'000'000;

/// What a configuration file says, and what is no TOML in it.
struct TomlFile {
  std::vector<Given> keys;  ///< in the order of the file; those of [limits] as "limits.key"
  Faults faults;            ///< what is no UTF-8 before what is no TOML
};

/// Reads TOML 1.0. What is wrong is left out and the rest is read all the same, so that everything
/// that is wrong is told at once; after `faults_max` faults it is left at that. `name` is how
/// places call the file. It takes time in proportion to the file, however much of it is wrong.
/// Thread safety: any thread. Limits: kConfigBytesMax.
[[nodiscard]] TomlFile read_toml(std::string_view text, const std::string& name,
                                 std::size_t faults_max = kConfigFaultsMax);

/// `text` as a TOML basic string, in quotes.
[[nodiscard]] std::string toml_quoted(std::string_view text);

}  // namespace gimnet::hub
