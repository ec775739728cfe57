#include "hub/limits.hpp"

#include <algorithm>
#include <array>
#include <charconv>
#include <optional>
#include <vector>

#include "base/log.hpp"
#include "base/suggest.hpp"
#include "proto/control/control_message.hpp"
#include "proto/frame/frame_header.hpp"

namespace gimnet::hub {
namespace {

constexpr std::uint64_t kKiB = 1024;
constexpr std::uint64_t kMiB = 1024 * kKiB;
constexpr std::uint64_t kGiB = 1024 * kMiB;
constexpr std::uint64_t kHour = 3'600'000;
constexpr std::uint64_t kYear = 365 * 24 * kHour;

constexpr std::array kTable{
    LimitInfo{"frame_bytes", "bytes", &Limits::frame_bytes, 65'536, proto::kFrameLengthMax,
              "largest frame after its header; 64 KiB is what every hub carries", false, true},
    LimitInfo{"turn_bytes", "bytes", &Limits::turn_bytes, 4 * kKiB, 16 * kMiB,
              "read from one connection before the next one has its turn", true},
    LimitInfo{"turn_deliveries", "deliveries", &Limits::turn_deliveries, 1, 16'777'216,
              "frames times recipients of one connection, or of what other shards handed over, "
              "before the next one has "
              "its turn; neighbouring frames with one header count as one"},
    LimitInfo{"stalled_frame_ms", "ms", &Limits::stalled_frame_ms, 100, kHour,
              "a frame that was begun must end within this time", true},
    LimitInfo{"partial_bytes", "bytes", &Limits::partial_bytes, kMiB, 64 * kGiB,
              "held by all frames that were begun and have not ended; each shard has an equal "
              "part, and room for one frame"},
    LimitInfo{"handshake_bytes", "bytes", &Limits::handshake_bytes, 256, 64 * kKiB,
              "opening and HELLO together: all that a stranger may make the hub keep", true},
    LimitInfo{"handshake_ms", "ms", &Limits::handshake_ms, 10, kHour,
              "time until HELLO must be there", false, true},
    LimitInfo{"handshakes", "connections", &Limits::handshakes, 1, 1'000'000,
              "connections without HELLO at a time; one more ends the oldest", true, true},
    LimitInfo{"handshakes_per_address", "connections", &Limits::handshakes_per_address, 1,
              1'000'000,
              "the same from one address; connections over loopback or a Unix socket do not count",
              true, true},
    LimitInfo{"nodes", "nodes", &Limits::nodes, 1, 1'000'000,
              "sessions, those within their grace time included; one address other than loopback, "
              "or one user other than root and the hub's own, has at most half",
              true, true},
    LimitInfo{"administrators", "nodes", &Limits::administrators, 0, 1'024,
              "places beyond nodes, and descriptors, that are kept for administrators", true, true},
    LimitInfo{"grace_ms", "ms", &Limits::grace_ms, 0, 24 * kHour,
              "time within which a node that lost its connection gets its id and name back", false,
              true},
    LimitInfo{
        "token_ms", "ms", &Limits::token_ms, 1'000, 10 * kYear,
        "time from its last connection for which a node's token is honoured while its id is free",
        true, true},
    LimitInfo{
        "kicked_tokens", "nodes", &Limits::kicked_tokens, 0, 65'536,
        "kicked nodes whose tokens a restarted hub still refuses; one more lets the oldest go",
        true},
    LimitInfo{"keep_alive_ms", "ms", &Limits::keep_alive_ms, 10, kHour,
              "a silent end says PING after this time", false, true},
    LimitInfo{"silent_ms", "ms", &Limits::silent_ms, 30, kHour,
              "a node that was not heard for this time is closed", false, true},
    LimitInfo{
        "unacknowledged_ms", "ms", &Limits::unacknowledged_ms, 100, kHour,
        "a node over TCP that is not read, since it went on after PAUSE, and takes nothing for "
        "this time is written "
        "to no more; it ends once what it sent is taken, at most max(grace_ms, silent_ms) later",
        true},
    LimitInfo{"lane0_bytes", "bytes", &Limits::lane0_bytes, 16 * kKiB, kGiB,
              "waiting for one node, real-time lane", true, true},
    LimitInfo{"lane1_bytes", "bytes", &Limits::lane1_bytes, 16 * kKiB, kGiB,
              "waiting for one node, normal lane", true, true},
    LimitInfo{"lane2_bytes", "bytes", &Limits::lane2_bytes, 16 * kKiB, kGiB,
              "waiting for one node, bulk lane", true, true},
    LimitInfo{"lane3_bytes", "bytes", &Limits::lane3_bytes, 16 * kKiB, kGiB,
              "waiting for one node, background lane", true, true},
    LimitInfo{"control_bytes", "bytes", &Limits::control_bytes, 16 * kKiB, kGiB,
              "answers, events and keep-alive waiting for one node", true, true},
    LimitInfo{"reserve_bytes", "bytes", &Limits::reserve_bytes, 16 * kKiB, kGiB,
              "above half of a lane, for what is under way when PAUSE is sent", true},
    LimitInfo{"budget_bytes", "bytes", &Limits::budget_bytes, 4 * kMiB, 1024 * kGiB,
              "kept from being freed by messages that wait for nodes, the whole hub", false, true},
    LimitInfo{"link_budget_bytes", "bytes", &Limits::link_budget_bytes, 4 * kMiB, 1024 * kGiB,
              "the same for links to other hubs", false, true},
    LimitInfo{"lane0_bytes_per_s", "bytes/s", &Limits::lane0_bytes_per_s, kKiB, 1024 * kGiB,
              "above this a node's real-time frames count as normal ones", true, true},
    LimitInfo{"block_ms", "ms", &Limits::block_ms, 10, kHour,
              "a message sent with BLOCK is dropped when its recipient took nothing for this time"},
    LimitInfo{"slow_consumer_ms", "ms", &Limits::slow_consumer_ms, 100, kHour,
              "time in which a node must take slow_consumer_bytes while messages wait"},
    LimitInfo{"slow_consumer_bytes", "bytes", &Limits::slow_consumer_bytes, 0, kGiB,
              "see slow_consumer_ms", true},
    LimitInfo{"resume_bytes", "bytes", &Limits::resume_bytes, 4 * kKiB, kGiB,
              "kept for one node until it confirms them, where it asked for resume", true, true},
    LimitInfo{"report_interval_ms", "ms", &Limits::report_interval_ms, 1, 10'000,
              "least time between two REPORTs of one reason to one node"},
    LimitInfo{"reports", "reports", &Limits::reports, 1, 16'384,
              "senders and reasons of which a shard prepares REPORTs; the drops of more are "
              "counted, but not reported"},
    LimitInfo{"socket_send_bytes", "bytes", &Limits::socket_send_bytes, 4 * kKiB, 64 * kMiB,
              "send buffer of a socket in the kernel", true},
    LimitInfo{"unsent_ms", "ms", &Limits::unsent_ms, 1, 10'000,
              "what a slow node takes in this time may be unsent in the kernel, where nothing "
              "overtakes it",
              true},
    LimitInfo{"unsent_bytes", "bytes", &Limits::unsent_bytes, 4 * kKiB, 64 * kMiB,
              "the same, at most", true},
    LimitInfo{"mailbox_entries", "entries", &Limits::mailbox_entries, 16, 1'000'000,
              "waiting from one shard to another"},
    LimitInfo{"mailbox_bytes", "bytes", &Limits::mailbox_bytes, 256 * kKiB, 16 * kGiB,
              "waiting from one shard to another"},
    LimitInfo{
        "requests", "requests", &Limits::requests, proto::kOpenRequestsMax, 65'536,
        "unanswered control requests of one node, WATCH_TAKEN among them; nodes count on the least",
        true},
    LimitInfo{"declarations_per_s", "declarations/s", &Limits::declarations_per_s, 1, 1'000'000,
              "names, services and subscriptions that one node may begin or change; repeating them "
              "is free",
              true, true},
    LimitInfo{"declarations_burst", "declarations", &Limits::declarations_burst, 1, 10'000'000,
              "the same at once; at least services_per_node and subscriptions_per_node together",
              true},
    LimitInfo{"oddities_per_s", "oddities/s", &Limits::oddities_per_s, 1, 1'000'000,
              "requests and credits of one node that are of no use (bad_request, not_supported, "
              "denied, bad_credits)",
              true},
    LimitInfo{"oddities_burst", "oddities", &Limits::oddities_burst, 1, 1'000'000,
              "the same at once; one more closes the connection", true},
    LimitInfo{"services_per_node", "services", &Limits::services_per_node, 0, 1'000'000,
              "advertised by one node", true, true},
    LimitInfo{"subscriptions_per_node", "subscriptions", &Limits::subscriptions_per_node, 0,
              1'000'000, "of one node, names without a service included", true, true},
    LimitInfo{"told_at_once", "subscribers", &Limits::told_at_once, 1, 1'000'000,
              "told of services in one piece, before others have their turn"},
    LimitInfo{"sync_window", "messages", &Limits::sync_window, 1, 1'000'000,
              "largest n of a service with delivery sync(n), and largest window of a subscription",
              true},
    LimitInfo{"subscription_depth", "messages", &Limits::subscription_depth, 1, 4'096,
              "largest number of newest messages held for one subscription", true},
    LimitInfo{"subscription_rate_hz", "Hz", &Limits::subscription_rate_hz, 1, 1'000,
              "largest maximal rate that a subscription may ask for; time is kept in ms", true},
    LimitInfo{"retained_message_bytes", "bytes", &Limits::retained_message_bytes, 0, kGiB,
              "application data of the message that is kept for one service with retain; a larger "
              "one is not kept. A map of 4,096 by 4,096 cells has as many",
              false, true},
    LimitInfo{"retained_budget_bytes", "bytes", &Limits::retained_budget_bytes, 0, 1024 * kGiB,
              "application data of the messages that are kept for services with retain, the whole "
              "hub; one node may have half of it",
              false, true},
    LimitInfo{"names_bytes", "bytes", &Limits::names_bytes, kMiB, 64 * kGiB,
              "names of nodes and services of all other hubs: each takes 288 bytes and its text; "
              "one hub may have half of it; beyond, no further names are taken of a hub",
              false, true},
    LimitInfo{"page_records", "records", &Limits::page_records, 1, 1'000,
              "in one answer to LIST and the like", true},
    LimitInfo{"scan_records", "records", &Limits::scan_records, 64, 1'000'000,
              "looked at for one page or one piece of watching, before others have their turn",
              true},
    LimitInfo{"watches_per_node", "watches", &Limits::watches_per_node, 0, 65'536,
              "of names and services, by one node", true, true},
    LimitInfo{"watches", "watches", &Limits::watches, 0, 1'000'000, "of all nodes together", true},
    LimitInfo{"watch_changes", "changes", &Limits::watch_changes, 1, 10'000'000,
              "kept for watches that are behind; one that is further behind gets a new snapshot",
              true},
    LimitInfo{"watch_bytes", "bytes", &Limits::watch_bytes, 64 * kKiB, 16 * kGiB,
              "memory of watch_changes", true},
    LimitInfo{"watch_event_bytes", "bytes", &Limits::watch_event_bytes, 8 * kKiB, 64 * kKiB,
              "one WATCH_EVENTS; it is sent once the longest change, of less than 6 KiB, might not "
              "fit any more",
              true},
    LimitInfo{"watch_window", "frames", &Limits::watch_window, 1, 1'024,
              "WATCH_EVENTS of one watch that were not answered with WATCH_TAKEN", true},
    LimitInfo{"watch_window_per_node", "frames", &Limits::watch_window_per_node, 1, 65'536,
              "the same of all watches of a node: they wait in control_bytes, beside its answers; "
              "one frame each watch may "
              "always have",
              true},
    LimitInfo{"drain_ms", "ms", &Limits::drain_ms, 0, kHour,
              "time for what waits to be written at the end", true, true},
    LimitInfo{"farewell_ms", "ms", &Limits::farewell_ms, 0, 60'000,
              "time for who was told GOODBYE to read it and close, before the hub does"},
    LimitInfo{"log_lines_per_s", "lines/s", &Limits::log_lines_per_s, 1, 1'000'000,
              "written to the log, twice as many at once; those that are left out are counted",
              true, true},
    LimitInfo{"peer_log_lines_per_s", "lines/s", &Limits::peer_log_lines_per_s, 1, 1'000'000,
              "of one kind about one peer, as many at once; those that are left out are counted",
              true, true},
};

std::string range_of(const LimitInfo& limit) {
  return std::to_string(limit.least) + " to " + std::to_string(limit.most) + " " +
         std::string{limit.unit};
}

struct Suffix {
  std::string_view text;
  std::uint64_t factor;
};
constexpr std::array kSuffixes{Suffix{"", 1}, Suffix{"k", kKiB}, Suffix{"K", kKiB},
                               Suffix{"M", kMiB}, Suffix{"G", kGiB}};
/// Units that people write where none is taken, and what they are in the limit's own unit.
constexpr std::array kTimeUnits{Suffix{"ms", 1}, Suffix{"s", 1'000}, Suffix{"min", 60'000},
                                Suffix{"h", kHour}};
constexpr std::array kByteUnits{Suffix{"B", 1},      Suffix{"kB", kKiB},  Suffix{"KB", kKiB},
                                Suffix{"KiB", kKiB}, Suffix{"MB", kMiB},  Suffix{"MiB", kMiB},
                                Suffix{"GB", kGiB},  Suffix{"GiB", kGiB}, Suffix{"bytes", 1}};

/// Digits and one of the suffixes. Nothing: not that, or beyond 64 bits.
std::optional<std::uint64_t> parse_amount(std::string_view text, std::span<const Suffix> suffixes) {
  std::uint64_t amount = 0;
  const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), amount);
  if (error != std::errc{}) return std::nullopt;
  const std::string_view suffix = text.substr(static_cast<std::size_t>(end - text.data()));
  for (const Suffix& each : suffixes) {
    if (each.text != suffix) continue;
    if (__builtin_mul_overflow(amount, each.factor, &amount)) return std::nullopt;
    return amount;
  }
  return std::nullopt;
}

bool is_time(const LimitInfo& limit) { return limit.unit == "ms"; }

/// The number that "30s" or "1MB" stands for, if it can be told: "; it is in ms: write 30000".
std::string unit_remedy(const LimitInfo& limit, std::string_view value) {
  const std::span<const Suffix> units =
      is_time(limit) ? std::span<const Suffix>{kTimeUnits} : kByteUnits;
  std::string close{value};
  std::erase(close, ' ');
  const std::optional<std::uint64_t> meant = parse_amount(close, units);
  if (!meant) return {};
  return "it is in " + std::string{limit.unit} + " and takes no other unit: write " +
         std::to_string(*meant);
}

}  // namespace

std::span<const LimitInfo> limit_table() { return kTable; }

std::span<const LimitInfo* const> limit_settings() {
  static const std::vector<const LimitInfo*> all = [] {
    std::vector<const LimitInfo*> settings;
    for (const LimitInfo& limit : kTable) {
      if (limit.setting) settings.push_back(&limit);
    }
    return settings;
  }();
  return all;
}

const LimitInfo* find_limit(std::string_view name) {
  const auto* const found = std::ranges::find(kTable, name, &LimitInfo::name);
  return found == kTable.end() ? nullptr : found;
}

std::string nearest_limit(std::string_view name) {
  std::vector<std::string_view> names;
  for (const LimitInfo* limit : limit_settings()) names.push_back(limit->name);
  return did_you_mean(name, names);
}

std::string set_limit(Limits& limits, const LimitInfo& limit, std::string_view value) {
  const std::string cannot_be =
      "limit " + std::string{limit.name} + " cannot be '" + escaped(value, kQuotedMax) + "': ";
  const std::span<const Suffix> all{kSuffixes};
  const std::optional<std::uint64_t> amount =
      parse_amount(value, is_time(limit) ? all.first(1) : all);
  if (!amount) {
    if (const std::string remedy = unit_remedy(limit, value); !remedy.empty())
      return cannot_be + remedy;
    const std::string suffixes = is_time(limit) ? "" : ", with k, M or G for powers of 1,024,";
    return cannot_be + "give a whole number" + suffixes + " in " + range_of(limit);
  }
  if (*amount < limit.least || *amount > limit.most) {
    return "limit " + std::string{limit.name} + " cannot be " + escaped(value, kQuotedMax) +
           ": it must be " + range_of(limit);
  }
  limits.*limit.field = *amount;
  return {};
}

}  // namespace gimnet::hub
