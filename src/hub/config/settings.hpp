#pragma once

#include <map>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "hub/config/hub_options.hpp"
#include "hub/config/value.hpp"

// The keys that a hub can be configured by: the flags' names with `_`. The limits, which are keys
// too, have a table of their own (hub/limits.hpp).

namespace gimnet::hub {

/// Options, and where each came from. A value type.
struct Configuration {
  HubOptions options;
  /// By key ("shards", "limits.nodes"); what is not in it is the default.
  std::map<std::string, std::string, std::less<>> origins;
  /// One for each of options.listen, for what can only be judged when all is known.
  std::vector<Fault> listen_places;
  std::map<std::string, Fault, std::less<>> places;  ///< as `origins`; the sentence is the label
};

/// A key outside [limits].
struct Setting {
  std::string_view key;
  std::string_view meaning;
  bool reloads;  ///< may it change while the hub runs?
  /// Sets it, or says what is wrong.
  void (*set)(Configuration&, const Given&, Faults&);
  /// The value as TOML.
  std::string (*show)(const HubOptions&);
};

[[nodiscard]] std::span<const Setting> settings();

/// Sets a key to a value; a later one replaces an earlier one. Faults: an unknown key, with the
/// nearest one; a value of the wrong type, unit or range. Thread safety: any thread.
void apply(Configuration& configuration, const Given& given, Faults& faults);

/// Fills in what follows from other values, and looks at what must agree. To be called last.
void complete(Configuration& configuration, Faults& faults);

/// What a hub of that configuration runs with, but may not do what it is told to: with numbers, and
/// what to do. REQUIRES: complete() was called.
[[nodiscard]] Faults warnings_about(const Configuration& configuration);

/// The whole configuration as TOML, each value with where it came from.
[[nodiscard]] std::string print(const Configuration& configuration);

}  // namespace gimnet::hub
