#include "hub/limits.hpp"

#include <array>
#include <charconv>
#include <vector>

#include "base/suggest.hpp"

namespace gimnet::hub {
namespace {

constexpr std::uint64_t kKiB = 1024;
constexpr std::uint64_t kMiB = 1024 * kKiB;
constexpr std::uint64_t kGiB = 1024 * kMiB;
constexpr std::uint64_t kHour = 3'600'000;

constexpr std::array kTable{
    LimitInfo{"frame_bytes", "bytes", &Limits::frame_bytes, 65'536, kMiB,
              "largest frame after its header; 64 KiB is what every hub carries"},
    LimitInfo{"turn_bytes", "bytes", &Limits::turn_bytes, 4 * kKiB, 16 * kMiB,
              "read from one connection before the next one has its turn"},
    LimitInfo{"stalled_frame_ms", "ms", &Limits::stalled_frame_ms, 100, kHour,
              "a frame that was begun must end within this time"},
    LimitInfo{"partial_bytes", "bytes", &Limits::partial_bytes, kMiB, 64 * kGiB,
              "held by all frames that were begun and have not ended"},
    LimitInfo{"handshake_bytes", "bytes", &Limits::handshake_bytes, 256, 64 * kKiB,
              "opening and HELLO together: all that a stranger may make the hub keep"},
    LimitInfo{"handshake_ms", "ms", &Limits::handshake_ms, 10, kHour, "time until HELLO must be there"},
    LimitInfo{"handshakes", "connections", &Limits::handshakes, 1, 1'000'000,
              "connections without HELLO at a time; one more ends the oldest"},
    LimitInfo{"nodes", "nodes", &Limits::nodes, 1, 1'000'000, "sessions, those within their grace time included"},
    LimitInfo{"grace_ms", "ms", &Limits::grace_ms, 0, 24 * kHour,
              "time within which a node that lost its connection gets its id and name back"},
    LimitInfo{"keep_alive_ms", "ms", &Limits::keep_alive_ms, 10, kHour, "a silent end says PING after this time"},
    LimitInfo{"silent_ms", "ms", &Limits::silent_ms, 30, kHour, "a node that was not heard for this time is closed"},
    LimitInfo{"lane0_bytes", "bytes", &Limits::lane0_bytes, 16 * kKiB, kGiB, "waiting for one node, real-time lane"},
    LimitInfo{"lane1_bytes", "bytes", &Limits::lane1_bytes, 16 * kKiB, kGiB, "waiting for one node, normal lane"},
    LimitInfo{"lane2_bytes", "bytes", &Limits::lane2_bytes, 16 * kKiB, kGiB, "waiting for one node, bulk lane"},
    LimitInfo{"lane3_bytes", "bytes", &Limits::lane3_bytes, 16 * kKiB, kGiB, "waiting for one node, background lane"},
    LimitInfo{"control_bytes", "bytes", &Limits::control_bytes, 16 * kKiB, kGiB,
              "answers, events and keep-alive waiting for one node"},
    LimitInfo{"reserve_bytes", "bytes", &Limits::reserve_bytes, 16 * kKiB, kGiB,
              "above the limit of a lane, for what is under way when PAUSE is sent"},
    LimitInfo{"budget_bytes", "bytes", &Limits::budget_bytes, 4 * kMiB, 1024 * kGiB,
              "kept from being freed by waiting messages, the whole hub"},
    LimitInfo{"lane0_bytes_per_s", "bytes/s", &Limits::lane0_bytes_per_s, kKiB, 1024 * kGiB,
              "above this a node's real-time frames count as normal ones"},
    LimitInfo{"block_ms", "ms", &Limits::block_ms, 10, kHour,
              "a message sent with BLOCK is dropped when its recipient took nothing for this time"},
    LimitInfo{"slow_consumer_ms", "ms", &Limits::slow_consumer_ms, 100, kHour,
              "time in which a node must take slow_consumer_bytes while messages wait"},
    LimitInfo{"slow_consumer_bytes", "bytes", &Limits::slow_consumer_bytes, 0, kGiB, "see slow_consumer_ms"},
    LimitInfo{"resume_bytes", "bytes", &Limits::resume_bytes, 4 * kKiB, kGiB,
              "kept for one node until it confirms them, where it asked for resume"},
    LimitInfo{"report_interval_ms", "ms", &Limits::report_interval_ms, 1, 10'000,
              "least time between two REPORTs of one reason to one node"},
    LimitInfo{"socket_send_bytes", "bytes", &Limits::socket_send_bytes, 4 * kKiB, 64 * kMiB,
              "send buffer of a socket in the kernel"},
    LimitInfo{"mailbox_entries", "entries", &Limits::mailbox_entries, 16, 1'000'000,
              "waiting from one shard to another"},
    LimitInfo{"mailbox_bytes", "bytes", &Limits::mailbox_bytes, 256 * kKiB, 16 * kGiB,
              "waiting from one shard to another"},
    LimitInfo{"requests", "requests", &Limits::requests, 1, 65'536, "unanswered control requests of one node"},
    LimitInfo{"services_per_node", "services", &Limits::services_per_node, 0, 1'000'000, "advertised by one node"},
    LimitInfo{"subscriptions_per_node", "subscriptions", &Limits::subscriptions_per_node, 0, 1'000'000,
              "of one node, names without a service included"},
    LimitInfo{"page_records", "records", &Limits::page_records, 1, 1'000, "in one answer to LIST and the like"},
    LimitInfo{"drain_ms", "ms", &Limits::drain_ms, 0, kHour, "time for what waits to be written at the end"},
};

std::string range_of(const LimitInfo& limit) {
  return std::to_string(limit.least) + " to " + std::to_string(limit.most) + " " + std::string{limit.unit};
}

/// Digits and at most one suffix. False: not a number, or beyond 64 bits.
bool parse_amount(std::string_view text, std::uint64_t& amount) {
  const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), amount);
  if (error != std::errc{}) return false;
  const std::string_view suffix = text.substr(static_cast<std::size_t>(end - text.data()));
  std::uint64_t unit = 1;
  if (suffix == "k" || suffix == "K") {
    unit = kKiB;
  } else if (suffix == "M") {
    unit = kMiB;
  } else if (suffix == "G") {
    unit = kGiB;
  } else if (!suffix.empty()) {
    return false;
  }
  return !__builtin_mul_overflow(amount, unit, &amount);
}

}  // namespace

std::span<const LimitInfo> limit_table() { return kTable; }

std::string set_limit(Limits& limits, std::string_view assignment) {
  const std::size_t equals = assignment.find('=');
  if (equals == std::string_view::npos) {
    return "--limit " + std::string{assignment} + " has no value: write NAME=VALUE, for example nodes=1000";
  }
  const std::string_view name = assignment.substr(0, equals);
  const std::string_view value = assignment.substr(equals + 1);
  std::vector<std::string_view> names;
  for (const LimitInfo& limit : kTable) {
    names.push_back(limit.name);
    if (limit.name != name) continue;
    std::uint64_t amount = 0;
    if (!parse_amount(value, amount)) {
      return "limit " + std::string{name} + " cannot be '" + std::string{value} +
             "': give a whole number, with k, M or G for powers of 1,024, in " + range_of(limit);
    }
    if (amount < limit.least || amount > limit.most) {
      return "limit " + std::string{name} + " cannot be " + std::string{value} + ": it must be " + range_of(limit);
    }
    limits.*limit.field = amount;
    return {};
  }
  return "there is no limit '" + std::string{name} + "'" + did_you_mean(name, names) +
         " (tcphub --help-limits shows all)";
}

}  // namespace gimnet::hub
