#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <string>
#include <string_view>

namespace gimnet {

enum class LogLevel : std::uint8_t { error = 0, warning = 1, info = 2, debug = 3, off = 4 };

inline constexpr std::array<std::string_view, 5> kLogLevelNames{"error", "warning", "info", "debug",
                                                                "off"};
[[nodiscard]] constexpr std::string_view log_level_name(LogLevel level) {
  return kLogLevelNames[static_cast<std::size_t>(level)];
}
/// One of kLogLevelNames; false for anything else.
[[nodiscard]] bool parse_log_level(std::string_view name, LogLevel& level);

/// Lines above this level are not written. `off` silences all. Default: info. Thread safety: any
/// thread.
void set_log_level(LogLevel level);
[[nodiscard]] LogLevel log_level();
[[nodiscard]] bool log_enabled(LogLevel level);

/// Lines a second of all kinds, twice as many in a burst; and of one kind about one peer. Each 1 to
/// 10^8.
struct LogRates {
  std::uint64_t all_per_s = 100;
  std::uint64_t peer_per_s = 10;
};
/// Thread safety: any thread.
void set_log_rates(const LogRates& rates);

/// Writes one line with time and level to standard error: one event, for people. Control characters
/// and broken text in `text`, which may come from strangers, are escaped. What the rates leave out,
/// and what standard error does not take at once, is counted in the next line: a log that nobody
/// reads holds nobody up. Thread safety: any thread. Never on the data path.
void log_line(LogLevel level, std::string_view text);

/// The subject of a line that a peer can make the hub write as often as it likes: the kind of line,
/// and the peer (without anything that changes from one connection to the next).
struct LogSubject {
  std::string_view reason;
  std::string_view peer;
};
/// The same for such a line, of which there are at most LogRates::peer_per_s.
void log_line(LogLevel level, const LogSubject& subject, std::string_view text);

inline void log_error(std::string_view text) { log_line(LogLevel::error, text); }
inline void log_warning(std::string_view text) { log_line(LogLevel::warning, text); }
inline void log_info(std::string_view text) { log_line(LogLevel::info, text); }
inline void log_debug(std::string_view text) { log_line(LogLevel::debug, text); }

/// So much of what somebody gave does a sentence repeat.
inline constexpr std::size_t kQuotedMax = 60;
/// `text` with control characters and bytes above 0x7e as \xNN, quotes and backslashes kept, cut to
/// `most` characters.
[[nodiscard]] std::string escaped(std::string_view text, std::size_t most = 1'000);

}  // namespace gimnet
