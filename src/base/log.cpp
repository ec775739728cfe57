#include "base/log.hpp"

#include <poll.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <atomic>
#include <cstdio>
#include <ctime>
#include <mutex>
#include <utility>

#include "base/clock.hpp"

namespace gimnet {
namespace {

constexpr std::int64_t kSecond = 1'000'000'000;

constinit std::atomic<LogLevel> level_now{LogLevel::info};

struct LogWriter {
  std::mutex mutex;
  LogRates rates;
  LogBudget budget;
  LogThrottle throttle;
};

LogWriter& writer() {
  static LogWriter instance;
  return instance;
}

std::string time_stamp() {
  const std::int64_t now = wall_now_ns();
  const std::time_t seconds = static_cast<std::time_t>(now / kSecond);
  std::tm parts{};
  ::gmtime_r(&seconds, &parts);
  std::array<char, 40> text{};
  const std::size_t size = std::strftime(text.data(), text.size(), "%Y-%m-%dT%H:%M:%S", &parts);
  std::array<char, 8> fraction{};
  std::snprintf(fraction.data(), fraction.size(), ".%03dZ",
                static_cast<int>(now % kSecond / 1'000'000));
  return std::string{text.data(), size} + fraction.data();
}

std::chrono::milliseconds now_ms() {
  return std::chrono::milliseconds{steady_now_ns() / 1'000'000};
}

/// A pipe that nobody reads, or a terminal that was stopped, takes nothing: who logs must not stand
/// still with it. A line is shorter than the page that a pipe has free when it can be written.
bool stderr_takes_a_line() {
  pollfd out{STDERR_FILENO, POLLOUT, 0};
  return ::poll(&out, 1, 0) != 0;
}

/// `alike`: lines of the same kind about the same peer that were left out before this one.
void write_line(LogWriter& out, LogLevel level, std::string_view text, std::uint64_t alike,
                std::chrono::milliseconds now) {
  out.budget.add_left_out(out.throttle.take_forgotten());
  if (!out.budget.take(out.rates.all_per_s, now)) return out.budget.add_left_out(alike);
  if (!stderr_takes_a_line()) return out.budget.add_left_out(1 + alike);
  std::string line = time_stamp() + " " + std::string{log_level_name(level)} + " " + escaped(text);
  if (alike > 0) line += " (" + std::to_string(alike) + " lines like this were left out)";
  if (const std::uint64_t count = out.budget.take_left_out(); count > 0) {
    line += " (" + std::to_string(count) + " lines before this were left out)";
  }
  line += '\n';
  static_cast<void>(
      !::write(STDERR_FILENO, line.data(), line.size()));  // nobody is left to tell about a failure
}

}  // namespace

bool parse_log_level(std::string_view name, LogLevel& level) {
  const auto* const found = std::find(kLogLevelNames.begin(), kLogLevelNames.end(), name);
  if (found == kLogLevelNames.end()) return false;
  level = static_cast<LogLevel>(found - kLogLevelNames.begin());
  return true;
}

// relaxed: the level stands alone, it publishes nothing.
void set_log_level(LogLevel level) { level_now.store(level, std::memory_order_relaxed); }
LogLevel log_level() { return level_now.load(std::memory_order_relaxed); }  // relaxed: as above

bool log_enabled(LogLevel level) {
  const LogLevel most = log_level();
  return most != LogLevel::off && level <= most;
}

void set_log_rates(const LogRates& rates) {
  LogWriter& out = writer();
  const std::lock_guard lock(out.mutex);
  out.rates = rates;
}

void log_line(LogLevel level, std::string_view text) {
  if (!log_enabled(level)) return;
  LogWriter& out = writer();
  const std::lock_guard lock(out.mutex);
  write_line(out, level, text, 0, now_ms());
}

void log_line(LogLevel level, const LogSubject& subject, std::string_view text) {
  if (!log_enabled(level)) return;
  LogWriter& out = writer();
  const std::lock_guard lock(out.mutex);
  const std::chrono::milliseconds now = now_ms();
  const LogThrottle::Verdict verdict =
      out.throttle.take(subject.reason, subject.peer, out.rates.peer_per_s, now);
  if (verdict.write) write_line(out, level, text, verdict.left_out, now);
}

std::string escaped(std::string_view text, std::size_t most) {
  std::string result;
  result.reserve(std::min(text.size(), most));
  for (const char c : text) {
    if (result.size() >= most) return result + "...";
    const auto byte = static_cast<unsigned char>(c);
    if (byte >= 0x20 && byte < 0x7f) {
      result += c;
    } else {
      std::array<char, 8> code{};
      std::snprintf(code.data(), code.size(), "\\x%02x", byte);
      result += code.data();
    }
  }
  return result;
}

bool LogBudget::take(std::uint64_t per_s, std::chrono::milliseconds now) {
  if (bucket_.take({per_s, 2 * per_s}, now)) return true;
  ++left_out_;
  return false;
}

std::uint64_t LogBudget::take_left_out() { return std::exchange(left_out_, 0); }

LogThrottle::Verdict LogThrottle::take(std::string_view reason, std::string_view peer,
                                       std::uint64_t per_s, std::chrono::milliseconds now) {
  std::string name{reason};
  name += '\0';
  name += peer;
  Subject& subject = find(std::move(name));
  if (!subject.bucket.take({per_s, per_s}, now)) {
    ++subject.left_out;
    return {};
  }
  return {true, std::exchange(subject.left_out, 0)};
}

std::uint64_t LogThrottle::take_forgotten() { return std::exchange(forgotten_, 0); }

LogThrottle::Subject& LogThrottle::find(std::string name) {
  if (const auto known = by_name_.find(name); known != by_name_.end()) {
    subjects_.splice(subjects_.begin(), subjects_, known->second);
    return subjects_.front();
  }
  if (subjects_.size() == kSubjectsMax) {
    forgotten_ += subjects_.back().left_out;
    by_name_.erase(subjects_.back().name);
    subjects_.pop_back();
  }
  subjects_.emplace_front().name = std::move(name);
  by_name_.emplace(subjects_.front().name, subjects_.begin());
  return subjects_.front();
}

}  // namespace gimnet
