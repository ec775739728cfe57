#pragma once

#include <cstddef>
#include <map>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "base/ids.hpp"
#include "base/log.hpp"
#include "hub/config/value.hpp"
#include "hub/control/link_options.hpp"
#include "hub/control/listen_url.hpp"
#include "hub/control/state/sessions.hpp"
#include "hub/limits.hpp"

namespace gimnet::hub {

/// The options of a hub. A value type.
struct HubOptions {
  std::vector<ListenUrl> listen;  ///< empty: the default addresses
  std::size_t shards = 1;
  HubId id{1};
  bool id_configured = false;
  std::string name;       ///< "": after the id
  std::string state_dir;  ///< "": the default one
  Placement placement = Placement::spread;
  bool insecure = false;  ///< also where other machines can be reached, or reach this one
  bool spin = false;      ///< shards never sleep
  LogLevel log_level = LogLevel::info;
  LinksOptions links;
  Limits limits;

  [[nodiscard]] std::string shown_name() const {
    return name.empty() ? "hub-" + std::to_string(id.value()) : name;
  }
};

inline constexpr std::size_t kShardCountMax = 16;

/// Shards if nobody says: half of this machine's processors, since the nodes that a hub serves
/// often run beside it, at least 1 and at most 8.
[[nodiscard]] std::size_t default_shards();

// The keys that a hub can be configured by: the flags' names with `_`. The limits, which are keys
// too, have a table of their own (hub/limits.hpp).

/// Options, and where each came from. A value type.
struct Configuration {
  HubOptions options;
  /// By key ("shards", "limits.nodes"); what is not in it is the default.
  std::map<std::string, std::string, std::less<>> origins;
  /// One for each of options.listen, for what can only be judged when all is known.
  std::vector<ConfigFault> listen_places;
  std::vector<std::string> link_places;  ///< the same of options.links.dial
  std::string proxy{};                   ///< --proxy or GIMNET_PROXY, for links that name none
  std::map<std::string, std::string, std::less<>> places;  ///< as `origins`, for faults
};

/// A key outside [limits]: "shards", "links.allow".
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

/// The place of the first of two keys that is set; "": none of them.
[[nodiscard]] std::string place_of_either(const Configuration& configuration, const char* key,
                                          const char* other);

/// The whole configuration as TOML, each value with where it came from.
[[nodiscard]] std::string print(const Configuration& configuration);

}  // namespace gimnet::hub
