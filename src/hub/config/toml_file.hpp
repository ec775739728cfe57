#pragma once

#include <cstddef>
#include <string>
#include <string_view>
#include <vector>

#include "hub/config/value.hpp"

namespace gimnet::hub {

/// Most bytes of one configuration file.
inline constexpr std::size_t kConfigBytesMax = std::size_t{1} << 20;

/// The content of a configuration file, or why it cannot be read.
struct TomlFile {
  std::vector<Given> keys;  ///< in the order of the file; those of [limits] as "limits.key"
  Faults faults;            ///< the first thing that is no TOML: then there are no keys
};

/// Reads TOML 1.0. `name` is how places call the file. Thread safety: any thread. Limits:
/// kConfigBytesMax.
[[nodiscard]] TomlFile read_toml(std::string_view text, const std::string& name);

/// `text` as a TOML basic string, in quotes.
[[nodiscard]] std::string toml_quoted(std::string_view text);

}  // namespace gimnet::hub
