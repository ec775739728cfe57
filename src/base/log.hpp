#pragma once

#include <cstdint>
#include <string>
#include <string_view>

namespace gimnet {

enum class LogLevel : std::uint8_t { error = 0, warning = 1, info = 2, debug = 3, off = 4 };

/// "error", "warning", "info", "debug" or "off"; false for anything else.
[[nodiscard]] bool parse_log_level(std::string_view name, LogLevel& level);

/// Lines above this level are not written. `off` silences all. Default: info. Thread safety: any thread.
void set_log_level(LogLevel level);
[[nodiscard]] LogLevel log_level();
[[nodiscard]] bool log_enabled(LogLevel level);

/// Writes one line with time and level to standard error: one event, for people. Control characters and broken text
/// in `text`, which may come from strangers, are escaped. At most 100 lines a second (200 in a burst); what is left out
/// is counted in the next line.
/// Thread safety: any thread. Never on the data path.
void log_line(LogLevel level, std::string_view text);

inline void log_error(std::string_view text) { log_line(LogLevel::error, text); }
inline void log_warning(std::string_view text) { log_line(LogLevel::warning, text); }
inline void log_info(std::string_view text) { log_line(LogLevel::info, text); }
inline void log_debug(std::string_view text) { log_line(LogLevel::debug, text); }

/// `text` with control characters and bytes above 0x7e as \xNN, quotes and backslashes kept, cut to `most` characters.
[[nodiscard]] std::string escaped(std::string_view text, std::size_t most = 1'000);

/// How many lines may be written now: a bucket that fills with time. Thread safety: none.
class LogBudget {
 public:
  /// May a line be written at `now_ns`? If not it is counted as left out.
  [[nodiscard]] bool take(std::int64_t now_ns);
  /// Lines left out since this was last asked.
  [[nodiscard]] std::uint64_t left_out();

 private:
  std::int64_t last_ns_ = 0;
  std::int64_t nanotokens_ = -1;  ///< below zero: not used yet, so full
  std::uint64_t left_out_ = 0;
};

}  // namespace gimnet
