#pragma once

#include <cstdint>
#include <string>
#include <string_view>

#include "base/result.hpp"

namespace gimnet::impair {

/// The faults of a network: a fault proxy does them to every connection that it relays, each way
/// for itself. Times are in nanoseconds. The defaults change nothing.
struct Impairment {
  std::int64_t delay_ns = 0;        ///< of each byte, one way; 0 to 1 h
  std::int64_t jitter_ns = 0;       ///< the delay varies by up to this, both ways; never reorders
  std::uint64_t rate = 0;           ///< bytes a second; 0: no bound
  std::uint64_t queue = 0;          ///< bytes held at most, 0: queue_bytes() chooses
  std::uint64_t split = 0;          ///< writes pieces of 1 to this many bytes; 0: as they came
  std::int64_t stall_every_ns = 0;  ///< mean time from stall to stall; 0: none
  std::int64_t stall_for_ns = 200'000'000;  ///< length of such a stall
  std::int64_t cut_every_ns = 0;  ///< mean time from cut to cut of all connections; 0: none

  bool operator==(const Impairment&) const = default;

  /// Bytes that one way of a connection holds at most: `queue`, or what passes in the delay and 100
  /// ms more, 64 KiB to 16 MiB. Beyond it the sender is read no further, as behind a full router.
  [[nodiscard]] std::uint64_t queue_bytes() const;
};

/// The names that change_setting() takes, for messages and help.
inline constexpr std::string_view kSettingNames =
    "delay, jitter, rate, queue, split, stall-every, stall-for or cut-every";

/// Sets the one that `name` names from words such as 80ms, 1.5s, 1MB, 64KiB, 7 or off. Errors: a
/// sentence that names the word and what can be given; nothing has changed then.
[[nodiscard]] Result<Impairment> change_setting(Impairment impairment, std::string_view name,
                                                std::string_view value);

/// Nanoseconds, 0 to 1 h, of words such as 250us, 80ms, 1.5s, 2min; "off" and "0" are 0.
[[nodiscard]] Result<std::int64_t> parse_duration(std::string_view word);

/// Bytes, 0 to 10^12, of words such as 7, 64KiB, 1.5MB; "off" and "0" are 0.
[[nodiscard]] Result<std::uint64_t> parse_bytes(std::string_view word);

}  // namespace gimnet::impair
