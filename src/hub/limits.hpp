#pragma once

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <span>
#include <string>
#include <string_view>

// Everything that the hub bounds, with unit, default, range and reason: the table in limits.cpp.
// Those that operators turn are settings: `tcphub --help-limits` shows them, and they are set by
// `--limit NAME=VALUE`, by TCPHUB_LIMITS_NAME or in the configuration's [limits]. Tests reach all
// others by `--limit`.

namespace gimnet::hub {

/// The limits in force. Thread safety: each thread that looks at them has its own, which it changes
/// between two steps of its work.
struct Limits {
  // Frames and turns
  std::uint64_t frame_bytes = 65'536;
  std::uint64_t turn_bytes = 256 * 1024;
  std::uint64_t turn_deliveries = 16'384;
  std::uint64_t stalled_frame_ms = 30'000;
  std::uint64_t partial_bytes = 64ull << 20;
  // Joining
  std::uint64_t handshake_bytes = 1'024;
  std::uint64_t handshake_ms = 5'000;
  std::uint64_t handshakes = 4'096;
  // 3 % of `handshakes`, and more than the programs that a busy robot starts at once behind one
  // address: its kernel has their connections before they run and say HELLO.
  std::uint64_t handshakes_per_address = 128;
  std::uint64_t nodes = 100'000;
  std::uint64_t administrators = 8;
  std::uint64_t grace_ms = 30'000;
  std::uint64_t token_ms = 31'536'000'000;
  std::uint64_t kicked_tokens = 4'096;
  // Keep-alive
  std::uint64_t keep_alive_ms = 1'000;
  std::uint64_t silent_ms = 3'000;
  std::uint64_t unacknowledged_ms = 15'000;
  // Outboxes
  std::uint64_t lane0_bytes = 512 * 1024;
  std::uint64_t lane1_bytes = 1536 * 1024;
  std::uint64_t lane2_bytes = 1536 * 1024;
  std::uint64_t lane3_bytes = 512 * 1024;
  std::uint64_t control_bytes = 256 * 1024;
  std::uint64_t reserve_bytes = 1ull << 20;
  std::uint64_t budget_bytes = 256ull << 20;
  std::uint64_t link_budget_bytes = 256ull << 20;
  std::uint64_t lane0_bytes_per_s = 64ull << 20;
  std::uint64_t block_ms = 5'000;
  std::uint64_t slow_consumer_ms = 10'000;
  std::uint64_t slow_consumer_bytes = 4'096;
  std::uint64_t resume_bytes = 1ull << 20;
  std::uint64_t report_interval_ms = 10;
  std::uint64_t reports = 4'096;
  std::uint64_t socket_send_bytes = 256 * 1024;
  std::uint64_t unsent_ms = 40;
  std::uint64_t unsent_bytes = 128 * 1024;
  // Between shards
  std::uint64_t mailbox_entries = 8'192;
  std::uint64_t mailbox_bytes = 16ull << 20;
  // Control
  std::uint64_t requests = 64;
  std::uint64_t declarations_per_s = 500;
  std::uint64_t declarations_burst = 2'048;
  std::uint64_t oddities_per_s = 100;
  std::uint64_t oddities_burst = 1'000;
  std::uint64_t services_per_node = 1'024;
  std::uint64_t subscriptions_per_node = 1'024;
  std::uint64_t told_at_once = 4'096;
  std::uint64_t sync_window = 1'024;
  std::uint64_t subscription_depth = 64;
  std::uint64_t subscription_rate_hz = 1'000;
  std::uint64_t retained_message_bytes = 16ull << 20;
  std::uint64_t retained_budget_bytes = 64ull << 20;
  std::uint64_t names_bytes = 64ull << 20;
  std::uint64_t page_records = 256;
  std::uint64_t scan_records = 4'096;
  std::uint64_t watches_per_node = 16;
  std::uint64_t watches = 16'384;
  std::uint64_t watch_changes = 65'536;
  std::uint64_t watch_bytes = 16ull << 20;
  std::uint64_t watch_event_bytes = 10 * 1024;
  std::uint64_t watch_window = 4;
  std::uint64_t watch_window_per_node = 12;
  std::uint64_t drain_ms = 10'000;
  std::uint64_t farewell_ms = 1'000;
  // The log
  std::uint64_t log_lines_per_s = 100;
  std::uint64_t peer_log_lines_per_s = 10;

  /// The largest message of a retained service that can be kept: one node has half of the budget.
  [[nodiscard]] std::uint64_t retained_most() const {
    return std::min(retained_message_bytes, retained_budget_bytes / 2);
  }
  /// Those of the four fields laneN_bytes. REQUIRES: lane < 4.
  [[nodiscard]] std::uint64_t lane_bytes(std::size_t lane) const {
    // A table of members, not of values: each message that is queued asks.
    static constexpr std::uint64_t Limits::* kByLane[] = {
        &Limits::lane0_bytes, &Limits::lane1_bytes, &Limits::lane2_bytes, &Limits::lane3_bytes};
    return this->*kByLane[lane];
  }
};

/// One row of the table of limits.
struct LimitInfo {
  std::string_view name;
  std::string_view unit;
  std::uint64_t Limits::* field;
  std::uint64_t least;
  std::uint64_t most;
  std::string_view reason;
  /// May it change while the hub runs? Not what memory was laid out by, nor what peers were told
  /// and rely on.
  bool reloads = false;
  /// Do operators turn it? If not, only `--limit` reaches it.
  bool setting = false;
};

/// All limits, in the order in which documents list those that are settings.
[[nodiscard]] std::span<const LimitInfo> limit_table();
/// The settings of the table, in its order.
[[nodiscard]] std::span<const LimitInfo* const> limit_settings();

/// nullptr: there is none of that name.
[[nodiscard]] const LimitInfo* find_limit(std::string_view name);
/// "; did you mean nodes?" for the setting whose name is nearest, or "".
[[nodiscard]] std::string nearest_limit(std::string_view name);

/// Sets one limit to a whole number, with an optional suffix k, M or G for powers of 1,024 (not for
/// times). Returns an empty string, or what is wrong and what to do.
[[nodiscard]] std::string set_limit(Limits& limits, const LimitInfo& limit, std::string_view value);

}  // namespace gimnet::hub
