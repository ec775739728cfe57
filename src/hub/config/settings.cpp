#include "hub/config/settings.hpp"

#include <sched.h>

#include <algorithm>
#include <array>
#include <optional>
#include <set>

#include "base/suggest.hpp"
#include "hub/config/folders.hpp"
#include "hub/config/link_settings.hpp"
#include "hub/config/toml_file.hpp"
#include "hub/version.hpp"
#include "proto/control/names.hpp"

namespace gimnet::hub {
namespace {

using Kind = ConfigValue::Kind;

constexpr std::string_view kLimits = "limits.";
constexpr std::string_view kLinks = "links.";
constexpr std::array<std::string_view, 2> kPlacements{"spread", "hint"};

/// Each of them is another one.
bool any_free_port(const ListenUrl& url) {
  return url.scheme == ListenUrl::Scheme::tcp && url.port == 0;
}

void set_listen(Configuration& configuration, const Given& given, Faults& faults) {
  std::vector<ConfigValue> urls = given.value.items;
  if (given.value.kind == Kind::text) urls = {given.value};
  if (given.value.kind != Kind::text &&
      !has_kind(given, Kind::list, "listen = [\"tcp://127.0.0.1:7450\"]", faults)) {
    return;
  }
  configuration.options.listen.clear();
  configuration.listen_places.clear();
  if (urls.empty()) {
    faults.push_back(
        value_fault(given, given.label + " names no address; leave it out for the default ones"));
  }
  std::set<std::string> known;
  for (const ConfigValue& url : urls) {
    if (url.kind != Kind::text && url.kind != Kind::words) {
      faults.push_back({url.place, "an address of listen is a text, not " +
                                       std::string{kind_name(url.kind)} +
                                       ": write \"tcp://127.0.0.1:7450\""});
      continue;
    }
    const Result<ListenUrl> parsed = parse_listen_url(url.text);
    if (!parsed) {
      faults.push_back({url.place, parsed.error().sentence});
    } else if (!known.insert(parsed->text()).second && !any_free_port(*parsed)) {
      faults.push_back(
          {url.place, given.label + " " + escaped(url.text, kQuotedMax) + " is given twice"});
    } else {
      configuration.options.listen.push_back(*parsed);
      configuration.listen_places.push_back({url.place, given.label});
    }
  }
}

void set_shards(Configuration& configuration, const Given& given, Faults& faults) {
  if (const auto shards = number_in(given, 1, kShardCountMax, faults))
    configuration.options.shards = *shards;
}

void set_hub_id(Configuration& configuration, const Given& given, Faults& faults) {
  const auto id = number_in(given, 1, kHubIdMax, faults);
  if (!id) return;
  configuration.options.id = HubId{static_cast<std::uint16_t>(*id)};
  configuration.options.id_configured = true;
}

void set_hub_name(Configuration& configuration, const Given& given, Faults& faults) {
  if (!has_kind(given, Kind::text, "hub_name = \"hall\"", faults)) return;
  if (const char* wrong = proto::name_fault(given.value.text)) {
    faults.push_back(value_fault(given, given.label + " cannot be '" +
                                            escaped(given.value.text, kQuotedMax) + "': " + wrong));
    return;
  }
  configuration.options.name = given.value.text;
}

void set_state_dir(Configuration& configuration, const Given& given, Faults& faults) {
  if (!has_kind(given, Kind::text, "state_dir = \"/var/lib/tcphub\"", faults)) return;
  if (given.value.kind == Kind::words && given.value.text.empty()) {
    // Mostly a shell variable that is not set; a hub that kept its state elsewhere would begin
    // anew.
    faults.push_back(
        value_fault(given, given.label + " is empty: give it a folder, or leave it out"));
    return;
  }
  if (given.value.text.find('\0') != std::string::npos) {
    faults.push_back(
        value_fault(given, given.label + " cannot be a path: there is a zero byte in it"));
    return;
  }
  configuration.options.state_dir = given.value.text;
}

void set_placement(Configuration& configuration, const Given& given, Faults& faults) {
  if (!one_of(given, kPlacements, "spread or hint", faults)) return;
  configuration.options.placement =
      given.value.text == "hint" ? Placement::hint : Placement::spread;
}

template <bool HubOptions::* option>
void set_flag(Configuration& configuration, const Given& given, Faults& faults) {
  if (const auto value = true_or_false(given, faults)) configuration.options.*option = *value;
}

template <bool HubOptions::* option>
std::string show_flag(const HubOptions& options) {
  return options.*option ? "true" : "false";
}

void set_log_level(Configuration& configuration, const Given& given, Faults& faults) {
  if (!one_of(given, kLogLevelNames, "error, warning, info, debug or off", faults)) return;
  static_cast<void>(parse_log_level(given.value.text, configuration.options.log_level));
}

std::string show_listen(const HubOptions& options) {
  std::vector<std::string> urls;
  urls.reserve(options.listen.size());
  for (const ListenUrl& url : options.listen) urls.push_back(url.text());
  if (urls.empty()) urls = default_addresses();
  std::string list;
  for (const std::string& url : urls) list += (list.empty() ? "" : ", ") + toml_quoted(url);
  return "[" + list + "]";
}

std::string show_log_level(const HubOptions& options) {
  return toml_quoted(log_level_name(options.log_level));
}

constexpr std::array kSettings{
    Setting{"listen", "addresses to listen on: tcp://HOST:PORT or unix:/PATH", false, set_listen,
            show_listen},
    Setting{"shards", "threads that carry data, 1 to 16", false, set_shards,
            [](const HubOptions& options) { return std::to_string(options.shards); }},
    Setting{"hub_id", "the hub's number, 1 to 4094", false, set_hub_id,
            [](const HubOptions& options) { return std::to_string(options.id.value()); }},
    Setting{"hub_name", "its name for people", false, set_hub_name,
            [](const HubOptions& options) { return toml_quoted(options.shown_name()); }},
    Setting{"state_dir", "folder of what the hub keeps over its restarts; \"\" is the default one",
            false, set_state_dir,
            [](const HubOptions& options) { return toml_quoted(options.state_dir); }},
    Setting{"placement", "where new nodes live: spread or hint", false, set_placement,
            [](const HubOptions& options) {
              return toml_quoted(kPlacements[options.placement == Placement::hint ? 1 : 0]);
            }},
    Setting{"spin", "shards never sleep", false, set_flag<&HubOptions::spin>,
            show_flag<&HubOptions::spin>},
    Setting{"insecure", "allows addresses of other machines", false,
            set_flag<&HubOptions::insecure>, show_flag<&HubOptions::insecure>},
    Setting{"log_level", "error, warning, info, debug or off", true, set_log_level, show_log_level},
    Setting{"link", "links to other hubs that this one dials", false, set_link, show_link},
    Setting{"links.accept_links", "takes links that other hubs dial", false, set_accept_links,
            [](const HubOptions& options) {
              return std::string{options.links.accept ? "true" : "false"};
            }},
    Setting{"links.keep_alive_ms", "sign of life on links that others dial", false,
            set_accepted_terms,
            [](const HubOptions& options) {
              return std::to_string(options.links.accepted.keep_alive_ms);
            }},
    Setting{
        "links.silent_ms", "silence that ends a link that another hub dialled", false,
        set_accepted_terms,
        [](const HubOptions& options) { return std::to_string(options.links.accepted.silent_ms); }},
    Setting{"links.allow", "hubs that such a link may bring frames of; [] is all", false,
            set_accepted_terms,
            [](const HubOptions& options) { return show_hubs(options.links.accepted.allow); }},
};

/// Every key, of limits the full name. A wrong file asks for them once for each of its lines.
const std::vector<std::string>& all_keys() {
  static const std::vector<std::string> all = [] {
    std::vector<std::string> keys;
    keys.reserve(std::size(kSettings) + 2 + limit_settings().size());
    for (const Setting& setting : kSettings) keys.emplace_back(setting.key);
    keys.emplace_back("limits");
    keys.emplace_back("links");
    for (const LimitInfo* limit : limit_settings())
      keys.push_back(std::string{kLimits} + std::string{limit->name});
    return keys;
  }();
  return all;
}

std::string nearest_key(std::string_view key) {
  if (const LimitInfo* limit = find_limit(key); limit != nullptr && limit->setting)
    return "; it is a limit: write it below [limits]";
  static const std::vector<std::string_view> keys(all_keys().begin(), all_keys().end());
  return did_you_mean(key, keys) + " (tcphub --print-config shows all)";
}

void apply_limit(Configuration& configuration, const Given& given, std::string_view name,
                 Faults& faults) {
  const LimitInfo* limit = find_limit(name);
  if (limit == nullptr || !(limit->setting || given.label == "--limit")) {
    faults.push_back({given.place, "there is no limit '" + escaped(name, kQuotedMax) + "'" +
                                       nearest_limit(name) + " (tcphub --help-limits shows all)"});
    return;
  }
  // A text may have a suffix: "64k".
  const bool number = given.value.kind == Kind::text || given.value.kind == Kind::words;
  const std::uint64_t instead =
      nearest_number(given.value, limit->least, limit->most, Limits{}.*(limit->field));
  if (!number &&
      !has_kind(given, Kind::integer, std::string{name} + " = " + std::to_string(instead), faults))
    return;
  std::string error = set_limit(configuration.options.limits, *limit, given.value.text);
  if (error.empty()) return;
  // Of a file the place says where that stands; of the environment only the variable's name can.
  if (given.origin.starts_with("environment ")) error = given.label + ": " + error;
  faults.push_back(value_fault(given, std::move(error)));
}

void keep_origin(Configuration& configuration, const Given& given) {
  configuration.origins[given.key] = given.origin;
  configuration.places[given.key] = given.value.place;
}

std::string origin_of(const Configuration& configuration, const std::string& key) {
  const auto found = configuration.origins.find(key);
  return found == configuration.origins.end() ? "default" : found->second;
}

}  // namespace

std::string place_of_either(const Configuration& configuration, const char* key,
                            const char* other) {
  auto where = configuration.places.find(key);
  if (where == configuration.places.end()) where = configuration.places.find(other);
  return where == configuration.places.end() ? "" : where->second;
}

std::size_t default_shards() {
  cpu_set_t set;
  CPU_ZERO(&set);
  const int processors = ::sched_getaffinity(0, sizeof set, &set) == 0 ? CPU_COUNT(&set) : 1;
  return static_cast<std::size_t>(std::clamp(processors / 2, 1, 8));
}

std::span<const Setting> settings() { return kSettings; }

void apply(Configuration& configuration, const Given& given, Faults& faults) {
  const std::size_t before = faults.size();
  if (given.key.starts_with(kLimits)) {
    apply_limit(configuration, given, std::string_view{given.key}.substr(kLimits.size()), faults);
  } else if (const auto* setting = std::ranges::find(kSettings, given.key, &Setting::key);
             setting != kSettings.end()) {
    setting->set(configuration, given, faults);
  } else if (given.key == "limits" || given.key == "links") {
    if (given.value.kind != Kind::table) {
      faults.push_back({given.place, given.key + " is a table: write [" + given.key +
                                         "], and below it a line NAME = VALUE for each"});
    }
    return;
  } else {
    faults.push_back({given.place, "there is no key '" + escaped(given.key, kQuotedMax) + "'" +
                                       nearest_key(given.key)});
  }
  if (faults.size() == before) keep_origin(configuration, given);
}

void complete(Configuration& configuration, Faults& faults) {
  const HubOptions& options = configuration.options;
  for (std::size_t i = 0; i < options.listen.size(); ++i) {
    if (options.listen[i].is_local() || options.insecure) continue;
    const ConfigFault& where = configuration.listen_places[i];
    const std::string word = where.place.empty() ? "--insecure" : "insecure = true";
    faults.push_back(
        {where.place,
         "cannot listen on " + options.listen[i].text() +
             ": other machines could reach it, and nothing that is sent is encrypted; where " +
             "all of them are trusted give " + word + ", otherwise listen on 127.0.0.1"});
  }
  complete_links(configuration, faults);
  const Limits& limits = options.limits;
  if (limits.silent_ms <= limits.keep_alive_ms) {
    faults.push_back({place_of_either(configuration, "limits.silent_ms", "limits.keep_alive_ms"),
                      "limit silent_ms (" + std::to_string(limits.silent_ms) +
                          ") must be larger than keep_alive_ms (" +
                          std::to_string(limits.keep_alive_ms) +
                          "), or healthy nodes are closed as silent"});
  }
}

std::string print(const Configuration& configuration) {
  std::string text = "# tcphub " + std::string{kVersion} +
                     ": the configuration in force, and where each value came from\n\n";
  bool in_links = false;
  for (const Setting& setting : kSettings) {
    const std::string key{setting.key};
    const bool below = key.starts_with(kLinks);
    if (below && !in_links) text += "\n[links]\n";
    in_links = below;
    text += (below ? key.substr(kLinks.size()) : key) + " = " +
            setting.show(configuration.options) + "  # " + origin_of(configuration, key) + "\n";
  }
  text += "\n[limits]\n";
  for (const LimitInfo* limit : limit_settings()) {
    const std::string name{limit->name};
    text += name + " = " + std::to_string(configuration.options.limits.*(limit->field)) + "  # " +
            origin_of(configuration, std::string{kLimits} + name) + "\n";
  }
  return text;
}

}  // namespace gimnet::hub
