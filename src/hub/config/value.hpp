#pragma once

#include <cstddef>
#include <cstdint>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <vector>

namespace gimnet::hub {

/// The value of a key as it was written, before it is understood. A value type.
struct ConfigValue {
  /// `words` come from the environment and the command line, where nothing tells a number from a
  /// text.
  enum class Kind : std::uint8_t { words, text, integer, boolean, fraction, time, list, table };

  Kind kind = Kind::words;
  std::string text;                ///< as written; a text without its quotes
  std::vector<ConfigValue> items;  ///< of a list, and of a table within one
  std::string place;               ///< "FILE:LINE:COLUMN", or "" for words
  std::string key{};               ///< of a value in such a table
};

/// A key and its value, from one of the places where they are set.
struct Given {
  std::string key;  ///< "shards", "limits.nodes"
  ConfigValue value;
  std::string place;   ///< of the key, as Value::place
  std::string label;   ///< how the place calls it: "shards", "TCPHUB_SHARDS", "--shards"
  std::string origin;  ///< for people: "FILE:LINE", "environment TCPHUB_SHARDS", "flag --shards"
};

/// Something that is wrong with a configuration.
struct ConfigFault {
  std::string place;     ///< "FILE:LINE:COLUMN", or ""
  std::string sentence;  ///< what is wrong, and what to do

  /// As it is printed: "FILE:LINE:COLUMN: sentence", or "tcphub: sentence".
  [[nodiscard]] std::string line() const { return (place.empty() ? "tcphub: " : "") + text(); }
  /// The same without the program's name.
  [[nodiscard]] std::string text() const { return (place.empty() ? "" : place + ": ") + sentence; }
  friend bool operator==(const ConfigFault&, const ConfigFault&) = default;
};

using Faults = std::vector<ConfigFault>;

// Reading a value. What is wrong with it is a fault, with what to write instead. Thread safety:
// pure functions.

/// Something that is wrong with the value.
[[nodiscard]] ConfigFault value_fault(const Given& given, std::string sentence);

/// A kind for people: "a whole number".
[[nodiscard]] std::string_view kind_name(ConfigValue::Kind kind);

/// Is the value of that kind? `example` is what to write instead.
[[nodiscard]] bool has_kind(const Given& given, ConfigValue::Kind wanted,
                            const std::string& example, Faults& faults);

/// The whole number to write instead of another value: the nearest one if the value reads as a
/// number, else `usual`.
[[nodiscard]] std::uint64_t nearest_number(const ConfigValue& value, std::uint64_t least,
                                           std::uint64_t most, std::uint64_t usual);

[[nodiscard]] std::optional<std::size_t> number_in(const Given& given, std::size_t least,
                                                   std::size_t most, Faults& faults);

/// Is it one of a few words? `list` is how a sentence names them.
[[nodiscard]] bool one_of(const Given& given, std::span<const std::string_view> words,
                          const std::string& list, Faults& faults);

[[nodiscard]] std::optional<bool> true_or_false(const Given& given, Faults& faults);

}  // namespace gimnet::hub
