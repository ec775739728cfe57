#include "impair/impairment.hpp"

#include <algorithm>
#include <array>
#include <charconv>
#include <cmath>
#include <optional>
#include <span>

namespace gimnet::impair {
namespace {

constexpr double kSecond = 1e9;
constexpr double kDurationMax = 3600 * kSecond;
constexpr double kBytesMax = 1e12;
constexpr std::uint64_t kQueueMin = 64 << 10;
constexpr std::uint64_t kQueueMax = 16 << 20;
constexpr double kQueueTime = 0.1;

struct Unit {
  std::string_view name;
  double factor;
};

constexpr std::array<Unit, 5> kDurations{
    {{"ns", 1}, {"us", 1e3}, {"ms", 1e6}, {"s", kSecond}, {"min", 60 * kSecond}}};
constexpr std::array<Unit, 10> kSizes{{{"", 1},
                                       {"B", 1},
                                       {"kB", 1e3},
                                       {"KB", 1e3},
                                       {"MB", 1e6},
                                       {"GB", 1e9},
                                       {"KiB", 1024},
                                       {"MiB", 1024.0 * 1024},
                                       {"GiB", 1024.0 * 1024 * 1024},
                                       {"k", 1e3}}};

/// Nothing where it is no number of one of the units, or is beyond `most`.
std::optional<double> quantity(std::string_view word, std::span<const Unit> units, double most) {
  if (word == "off" || word == "0") return 0.0;
  double number = 0;
  const auto [end, error] = std::from_chars(word.data(), word.data() + word.size(), number);
  if (error != std::errc() || !std::isfinite(number) || number < 0) return std::nullopt;
  const std::string_view name(end, static_cast<std::size_t>(word.data() + word.size() - end));
  const auto unit = std::ranges::find(units, name, &Unit::name);
  if (unit == units.end()) return std::nullopt;
  const double value = number * unit->factor;
  return value <= most ? std::optional(value) : std::nullopt;
}

}  // namespace

std::uint64_t Impairment::queue_bytes() const {
  if (queue != 0) return queue;
  if (rate == 0) return kQueueMax;
  const double time = kQueueTime + static_cast<double>(delay_ns) / kSecond;
  const double bytes = std::min(static_cast<double>(rate) * time, double{kQueueMax});
  return std::max(static_cast<std::uint64_t>(bytes), kQueueMin);
}

Result<std::int64_t> parse_duration(std::string_view word) {
  const auto value = quantity(word, kDurations, kDurationMax);
  if (value) return static_cast<std::int64_t>(std::llround(*value));
  return Error{"'" + std::string(word) +
               "' is no time: give one such as 250us, 80ms, 1.5s, 2min (up to 60min) or off"};
}

Result<std::uint64_t> parse_bytes(std::string_view word) {
  std::string_view size = word;
  if (size.ends_with("/s")) size.remove_suffix(2);
  const auto value = quantity(size, kSizes, kBytesMax);
  if (value) return static_cast<std::uint64_t>(std::llround(*value));
  return Error{"'" + std::string(word) +
               "' is no number of bytes: give one such as 7, 64KiB, 1.5MB (up to 1000GB) or off"};
}

Result<Impairment> change_setting(Impairment impairment, std::string_view name,
                                  std::string_view value) {
  struct Duration {
    std::string_view name;
    std::int64_t Impairment::* member;
  };
  struct Bytes {
    std::string_view name;
    std::uint64_t Impairment::* member;
  };
  constexpr std::array<Duration, 5> kDurationSettings{{{"delay", &Impairment::delay_ns},
                                                       {"jitter", &Impairment::jitter_ns},
                                                       {"stall-every", &Impairment::stall_every_ns},
                                                       {"stall-for", &Impairment::stall_for_ns},
                                                       {"cut-every", &Impairment::cut_every_ns}}};
  constexpr std::array<Bytes, 3> kByteSettings{
      {{"rate", &Impairment::rate}, {"queue", &Impairment::queue}, {"split", &Impairment::split}}};
  for (const Duration& setting : kDurationSettings) {
    if (setting.name != name) continue;
    const auto parsed = parse_duration(value);
    if (!parsed) return parsed.error();
    impairment.*setting.member = *parsed;
    return impairment;
  }
  for (const Bytes& setting : kByteSettings) {
    if (setting.name != name) continue;
    const auto parsed = parse_bytes(value);
    if (!parsed) return parsed.error();
    impairment.*setting.member = *parsed;
    return impairment;
  }
  return Error{"there is no setting '" + std::string(name) + "': give " +
               std::string(kSettingNames)};
}

}  // namespace gimnet::impair
