#pragma once

#include <array>
#include <chrono>
#include <cstddef>
#include <cstdint>
#include <list>
#include <map>
#include <string>
#include <string_view>

#include "base/token_bucket.hpp"

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

/// Bounds the lines of all kinds that may be written now. Thread safety: none.
class LogBudget {
 public:
  /// May a line be written? If not it is counted as left out. Twice as many as `per_s` in a burst.
  [[nodiscard]] bool take(std::uint64_t per_s, std::chrono::milliseconds now);
  void add_left_out(std::uint64_t lines) { left_out_ += lines; }
  /// Lines left out since this was last asked.
  [[nodiscard]] std::uint64_t take_left_out();

 private:
  TokenBucket bucket_;
  std::uint64_t left_out_ = 0;
};

/// Bounds the lines of one kind about one peer that may be written now. So a peer that makes the
/// same mistake again and again neither fills the log nor keeps others out of it. Thread safety:
/// none. Limits: knows the latest 1,024 subjects; one that is forgotten begins anew.
class LogThrottle {
 public:
  static constexpr std::size_t kSubjectsMax = 1'024;

  struct Verdict {
    bool write = false;
    std::uint64_t left_out =
        0;  ///< lines of this subject since the last one that was written; 0 unless `write`
  };
  /// May a line of that kind about that peer be written? If not it is counted as left out.
  [[nodiscard]] Verdict take(std::string_view reason, std::string_view peer, std::uint64_t per_s,
                             std::chrono::milliseconds now);
  /// Lines left out of subjects that were forgotten since this was last asked.
  [[nodiscard]] std::uint64_t take_forgotten();
  [[nodiscard]] std::size_t subjects() const { return by_name_.size(); }

 private:
  struct Subject {
    std::string name;
    TokenBucket bucket;
    std::uint64_t left_out = 0;
  };
  using Subjects = std::list<Subject>;  ///< Limit: kSubjectsMax

  Subject& find(std::string name);

  Subjects subjects_;  ///< the one that was asked for last is the first
  std::map<std::string_view, Subjects::iterator> by_name_;
  std::uint64_t forgotten_ = 0;
};

}  // namespace gimnet
