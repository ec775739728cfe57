#include "tools/demo/text_format.hpp"

#include <fmt/format.h>

#include <algorithm>

namespace gimnet::demo {

std::string duration_text(std::optional<std::int64_t> duration_ns) {
  if (!duration_ns) return "–";
  const double microseconds = static_cast<double>(*duration_ns) * 1e-3;
  if (microseconds < 999.5) return fmt::format("{:.0f} µs", microseconds);
  if (microseconds < 9.995e3) return fmt::format("{:.2f} ms", microseconds * 1e-3);
  if (microseconds < 99.95e3) return fmt::format("{:.1f} ms", microseconds * 1e-3);
  if (microseconds < 999.5e3) return fmt::format("{:.0f} ms", microseconds * 1e-3);
  return fmt::format("{:.2f} s", microseconds * 1e-6);
}

std::string count_text(std::uint64_t count) {
  std::string digits = fmt::format("{}", count);
  for (std::size_t place = digits.size(); place > 3; place -= 3) digits.insert(place - 3, 1, ',');
  return digits;
}

std::string clock_text(double seconds) {
  const auto whole = static_cast<std::uint64_t>(std::clamp(seconds, 0.0, 1e9));
  if (whole < 3600) return fmt::format("{}:{:02}", whole / 60, whole % 60);
  return fmt::format("{}:{:02}:{:02}", whole / 3600, whole / 60 % 60, whole % 60);
}

}  // namespace gimnet::demo
