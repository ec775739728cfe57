#include "hub/config/link_settings.hpp"

#include <algorithm>
#include <array>
#include <optional>
#include <string_view>

#include "base/log.hpp"
#include "base/suggest.hpp"
#include "hub/config/toml_file.hpp"
#include "net/proxy_address.hpp"

namespace gimnet::hub {
namespace {

using Kind = ConfigValue::Kind;

constexpr std::array<std::string_view, 7> kLinkKeys{"url",       "name",  "cost", "keep_alive_ms",
                                                    "silent_ms", "allow", "proxy"};
constexpr const char* kLinkExample = "write [[link]], and below it url = \"tcp://127.0.0.1:7451\"";

void set_allow(LinkTerms& terms, const Given& given, Faults& faults) {
  if (given.value.kind != Kind::list) {
    static_cast<void>(has_kind(given, Kind::list, "allow = [2, 3]", faults));
    return;
  }
  std::vector<HubId> hubs;
  const std::size_t before = faults.size();
  for (const ConfigValue& item : given.value.items) {
    Given hub = given;
    hub.value = item;
    hub.label = "a hub of " + given.label;
    if (const auto id = number_in(hub, 1, kHubIdMax, faults))
      hubs.emplace_back(static_cast<std::uint16_t>(*id));
  }
  if (faults.size() != before) return;
  std::ranges::sort(hubs);
  const auto twice = std::ranges::unique(hubs);
  hubs.erase(twice.begin(), twice.end());
  terms.allow = std::move(hubs);
}

void set_term(LinkTerms& terms, std::string_view name, const Given& given, Faults& faults) {
  if (name == "allow") return set_allow(terms, given, faults);
  const bool silence = name == "silent_ms";
  const std::size_t least = silence ? kLinkSilentMsMin : kLinkKeepAliveMsMin;
  if (const auto ms = number_in(given, least, kLinkMsMax, faults))
    (silence ? terms.silent_ms : terms.keep_alive_ms) = static_cast<std::uint32_t>(*ms);
}

/// Why the terms cannot be, or "".
std::string terms_fault(const LinkTerms& terms) {
  if (terms.silent_ms > terms.keep_alive_ms) return {};
  return "silent_ms (" + std::to_string(terms.silent_ms) + ") must be larger than keep_alive_ms (" +
         std::to_string(terms.keep_alive_ms) + "), or a healthy link is ended as silent";
}

/// The text of a table's key; nothing if it is none.
std::optional<std::string> text_of(const Given& given, const std::string& example, Faults& faults) {
  if (!has_kind(given, Kind::text, example, faults)) return std::nullopt;
  return given.value.text;
}

/// A table [[link]] while it is read.
struct LinkTable {
  std::string url;
  std::string name;
  std::string url_place;
  DialledLink link{};
  bool proxy_given = false;
};

void set_proxy(LinkTable& table, const Given& given, Faults& faults) {
  const auto url = text_of(given, "proxy = \"http://127.0.0.1:3128\"", faults);
  if (!url) return;
  table.proxy_given = true;
  table.link.proxy = *url;
  if (url->empty()) return;
  if (const auto proxy = net::parse_proxy(*url); !proxy)
    faults.push_back(value_fault(given, proxy.error().sentence));
}

void set_key(LinkTable& table, const Given& given, Faults& faults) {
  const std::string& key = given.value.key;
  if (key == "url") {
    if (const auto url = text_of(given, "url = \"tcp://127.0.0.1:7451\"", faults)) table.url = *url;
    table.url_place = given.value.place;
  } else if (key == "name") {
    if (const auto name = text_of(given, "name = \"lab\"", faults)) table.name = *name;
  } else if (key == "cost") {
    if (const auto cost = number_in(given, 1, UINT16_MAX, faults))
      table.link.cost = static_cast<std::uint16_t>(*cost);
  } else if (key == "proxy") {
    set_proxy(table, given, faults);
  } else if (std::ranges::find(kLinkKeys, key) != kLinkKeys.end()) {
    set_term(table.link.terms, key, given, faults);
  } else {
    faults.push_back(value_fault(given, "a link has no key '" + escaped(key, kQuotedMax) + "'" +
                                            did_you_mean(key, kLinkKeys)));
  }
}

/// Nothing: what is wrong is among the faults.
std::optional<LinkTable> read_table(const Given& given, const ConfigValue& item, Faults& faults) {
  LinkTable table;
  if (item.kind == Kind::words) {  // of a flag, or of the environment
    table.url = item.text;
    return table;
  }
  if (item.kind != Kind::table) {
    faults.push_back({item.place, "a link is a table, not " + std::string{kind_name(item.kind)} +
                                      ": " + kLinkExample});
    return std::nullopt;
  }
  const std::size_t before = faults.size();
  for (const ConfigValue& entry : item.items) {
    set_key(table, {given.key, entry, entry.place, "link." + entry.key, given.origin}, faults);
  }
  if (table.url_place.empty())
    faults.push_back({item.place, std::string{"this link has no url: "} + kLinkExample});
  if (const std::string why = terms_fault(table.link.terms); !why.empty())
    faults.push_back({item.place, "of this link " + why});
  if (faults.size() != before) return std::nullopt;
  return table;
}

/// Adds it to the configuration.
void add_link(Configuration& configuration, const LinkTable& table, const std::string& place,
              Faults& faults) {
  std::vector<DialledLink>& all = configuration.options.links.dial;
  Result<DialledLink> link = make_link(table.url, table.name);
  if (!link) {
    faults.push_back({place, link.error().sentence});
    return;
  }
  link->cost = table.link.cost;
  link->terms = table.link.terms;
  const bool tcp = link->address.scheme == net::Address::Scheme::tcp;
  if (!tcp && !table.link.proxy.empty()) {
    faults.push_back({place, net::proxy_towards(link->address, table.link.proxy).error().sentence});
    return;
  }
  link->proxy = table.proxy_given || !tcp ? table.link.proxy : configuration.proxy;
  if (std::ranges::find(all, link->name, &DialledLink::name) != all.end()) {
    faults.push_back(
        {place, "link '" + link->name +
                    "' is given twice: leave one out, or give each a name of its own"});
    return;
  }
  all.push_back(std::move(*link));
  configuration.link_places.push_back(place);
}

}  // namespace

void set_link(Configuration& configuration, const Given& given, Faults& faults) {
  if (given.value.kind != Kind::list) {
    faults.push_back(value_fault(given, given.label + " is a list of tables, not " +
                                            std::string{kind_name(given.value.kind)} + ": " +
                                            kLinkExample));
    return;
  }
  if (given.value.items.size() > kDialledLinksMax) {
    faults.push_back(value_fault(given, "there are " + std::to_string(given.value.items.size()) +
                                            " links; a hub dials at most " +
                                            std::to_string(kDialledLinksMax)));
    return;
  }
  if (given.value.items.empty() && given.value.place.empty()) {
    faults.push_back(value_fault(given, given.label + " is empty: give it a URL, or leave it out"));
    return;
  }
  configuration.options.links.dial.clear();
  configuration.link_places.clear();
  for (const ConfigValue& item : given.value.items) {
    const std::optional<LinkTable> table = read_table(given, item, faults);
    if (!table) continue;
    add_link(configuration, *table, table->url_place, faults);
  }
}

std::string show_link(const HubOptions& options) {
  std::string list;
  for (const DialledLink& link : options.links.dial) {
    const LinkTerms& terms = link.terms;
    list += (list.empty() ? "" : ", ");
    list += "{ url = " + toml_quoted(link.address.url()) + ", name = " + toml_quoted(link.name);
    if (link.cost != 0) list += ", cost = " + std::to_string(link.cost);
    list += ", keep_alive_ms = " + std::to_string(terms.keep_alive_ms) +
            ", silent_ms = " + std::to_string(terms.silent_ms);
    if (!terms.allow.empty()) list += ", allow = " + show_hubs(terms.allow);
    if (!link.proxy.empty()) list += ", proxy = " + toml_quoted(net::shown_proxy(link.proxy));
    list += " }";
  }
  return "[" + list + "]";
}

void set_accept_links(Configuration& configuration, const Given& given, Faults& faults) {
  if (const auto value = true_or_false(given, faults)) configuration.options.links.accept = *value;
}

void set_accepted_terms(Configuration& configuration, const Given& given, Faults& faults) {
  const std::string_view name = std::string_view{given.key}.substr(given.key.find('.') + 1);
  set_term(configuration.options.links.accepted, name, given, faults);
}

std::string show_hubs(const std::vector<HubId>& hubs) {
  std::string list;
  for (const HubId hub : hubs) list += (list.empty() ? "" : ", ") + std::to_string(hub.value());
  return "[" + list + "]";
}

void complete_links(Configuration& configuration, Faults& faults) {
  const HubOptions& options = configuration.options;
  const auto uses = [&](const DialledLink& link) { return link.proxy == configuration.proxy; };
  if (!configuration.proxy.empty() && std::ranges::any_of(options.links.dial, uses)) {
    if (const auto proxy = net::parse_proxy(configuration.proxy); !proxy)
      faults.push_back({"", "--proxy or GIMNET_PROXY: " + proxy.error().sentence});
  }
  for (std::size_t i = 0; i < options.links.dial.size(); ++i) {
    const DialledLink& link = options.links.dial[i];
    if (options.insecure || is_local(link.address)) continue;
    const std::string& place = configuration.link_places[i];
    faults.push_back(
        {place, not_encrypted(link.address, place.empty() ? "--insecure" : "insecure = true")});
  }
  if (const std::string why = terms_fault(options.links.accepted); !why.empty()) {
    faults.push_back({place_of_either(configuration, "links.silent_ms", "links.keep_alive_ms"),
                      "of accepted links " + why});
  }
}

}  // namespace gimnet::hub
