#include "base/log.hpp"

#include <unistd.h>

#include <algorithm>
#include <array>
#include <atomic>
#include <cstdio>
#include <ctime>
#include <mutex>

#include "base/clock.hpp"

namespace gimnet {
namespace {

constexpr std::int64_t kSecond = 1'000'000'000;
constexpr std::int64_t kLinesPerSecond = 100;
constexpr std::int64_t kBurst = 200;
constexpr std::array<std::string_view, 5> kNames{"error", "warning", "info", "debug", "off"};

constinit std::atomic<LogLevel> level_now{LogLevel::info};

struct Writer {
  std::mutex mutex;
  LogBudget budget;
};

Writer& writer() {
  static Writer instance;
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
  std::snprintf(fraction.data(), fraction.size(), ".%03dZ", static_cast<int>(now % kSecond / 1'000'000));
  return std::string{text.data(), size} + fraction.data();
}

}  // namespace

bool parse_log_level(std::string_view name, LogLevel& level) {
  const auto* const found = std::find(kNames.begin(), kNames.end(), name);
  if (found == kNames.end()) return false;
  level = static_cast<LogLevel>(found - kNames.begin());
  return true;
}

// relaxed: the level stands alone, it publishes nothing.
void set_log_level(LogLevel level) { level_now.store(level, std::memory_order_relaxed); }
LogLevel log_level() { return level_now.load(std::memory_order_relaxed); }  // relaxed: as above

bool log_enabled(LogLevel level) {
  const LogLevel most = log_level();
  return most != LogLevel::off && level <= most;
}

void log_line(LogLevel level, std::string_view text) {
  if (!log_enabled(level)) return;
  Writer& out = writer();
  const std::lock_guard lock(out.mutex);
  if (!out.budget.take(steady_now_ns())) return;
  std::string line = time_stamp() + " " + std::string{kNames[static_cast<std::size_t>(level)]} + " " + escaped(text);
  if (const std::uint64_t count = out.budget.left_out(); count > 0) {
    line += " (" + std::to_string(count) + " lines before this were left out)";
  }
  line += '\n';
  static_cast<void>(!::write(STDERR_FILENO, line.data(), line.size()));  // nobody is left to tell about a failure
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

bool LogBudget::take(std::int64_t now_ns) {
  constexpr std::int64_t kFull = kBurst * kSecond;
  if (nanotokens_ < 0) {
    nanotokens_ = kFull;
  } else {
    const std::int64_t passed = std::min(std::max<std::int64_t>(now_ns - last_ns_, 0), kFull);
    nanotokens_ = std::min(kFull, nanotokens_ + passed * kLinesPerSecond);
  }
  last_ns_ = now_ns;
  if (nanotokens_ < kSecond) {
    ++left_out_;
    return false;
  }
  nanotokens_ -= kSecond;
  return true;
}

std::uint64_t LogBudget::left_out() {
  const std::uint64_t count = left_out_;
  left_out_ = 0;
  return count;
}

}  // namespace gimnet
