#pragma once

#include <cstdint>
#include <string>
#include <vector>

namespace gimnet::hub {

/// What somebody set a key to, before it is understood. A value type.
struct ConfigValue {
  /// `words` come from the environment and the command line, where nothing tells a number from a
  /// text.
  enum class Kind : std::uint8_t { words, text, integer, boolean, fraction, time, list, table };

  Kind kind = Kind::words;
  std::string text;                ///< as written; a text without its quotes
  std::vector<ConfigValue> items;  ///< of a list
  std::string place;               ///< "FILE:LINE:COLUMN", or "" for words
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
struct Fault {
  std::string place;     ///< "FILE:LINE:COLUMN", or ""
  std::string sentence;  ///< what is wrong, and what to do

  /// As it is printed: "FILE:LINE:COLUMN: sentence", or "tcphub: sentence".
  [[nodiscard]] std::string line() const { return (place.empty() ? "tcphub: " : "") + text(); }
  /// The same without the program's name.
  [[nodiscard]] std::string text() const { return (place.empty() ? "" : place + ": ") + sentence; }
  friend bool operator==(const Fault&, const Fault&) = default;
};

using Faults = std::vector<Fault>;

}  // namespace gimnet::hub
