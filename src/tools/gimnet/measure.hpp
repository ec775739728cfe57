#pragma once

#include <cstddef>
#include <cstdint>
#include <deque>
#include <string>
#include <vector>

#include "tools/gimnet/table.hpp"

namespace gimnet::tool {

/// Values seen one after the other: how many, least, most, mean and standard deviation. Thread
/// safety: one thread.
class MeterStatistics {
 public:
  void add(double value);
  [[nodiscard]] std::uint64_t count() const { return count_; }
  [[nodiscard]] double min() const { return min_; }
  [[nodiscard]] double max() const { return max_; }
  [[nodiscard]] double mean() const { return mean_; }
  [[nodiscard]] double sum() const { return mean_ * static_cast<double>(count_); }
  /// Of these values, not estimated for more; 0 for fewer than two.
  [[nodiscard]] double deviation() const;

 private:
  std::uint64_t count_ = 0;
  double min_ = 0.0;
  double max_ = 0.0;
  double mean_ = 0.0;
  double squares_ = 0.0;  ///< sum of squared distances from the mean (Welford's method)
};

/// The messages of one service in some time.
struct MeterReading {
  MeterStatistics gaps_ms;      ///< between a message and the one before it, ended in that time
  MeterStatistics sizes_bytes;  ///< payloads; its count is the number of messages
  double seconds = 0.0;         ///< the time itself
  double silent_s = 0.0;        ///< since the last message; of none: the whole time
  /// Messages a second by their gaps: exact however the time begins and ends. 0: fewer than two
  /// ever came.
  [[nodiscard]] double rate_hz() const;
  [[nodiscard]] double bytes_per_s() const {
    return seconds > 0.0 ? sizes_bytes.sum() / seconds : 0.0;
  }
};

/// Measures the messages of one service, over all the time and over the last of it. Times are
/// nanoseconds of any clock. Memory: the messages of the last window, at most kMessagesMax. Thread
/// safety: one thread.
class Meter {
 public:
  /// Messages of the window that are remembered; of more, the newest.
  static constexpr std::size_t kMessagesMax = 1'000'000;

  Meter(std::int64_t begin_ns, std::int64_t window_ns)
      : begin_ns_(begin_ns), window_ns_(window_ns) {}
  void add(std::int64_t at_ns, std::size_t bytes);
  /// Of the last window, or of the time since the beginning if that is shorter.
  [[nodiscard]] MeterReading recent(std::int64_t now_ns);
  /// Since the beginning.
  [[nodiscard]] MeterReading whole(std::int64_t now_ns) const;

 private:
  struct Arrival {
    std::int64_t at_ns;
    std::int64_t gap_ns;  ///< negative: the first of all
    std::size_t bytes;
  };
  static void count(MeterReading& reading, const Arrival& arrival);

  std::int64_t begin_ns_;
  std::int64_t window_ns_;
  std::int64_t last_ns_ = 0;
  std::deque<Arrival> arrivals_;  ///< Limit: kMessagesMax
  MeterReading whole_;
};

/// The figures of `gimnet hz` and `gimnet bw`.
enum class Measure : std::uint8_t { rate, bytes };
/// Of what time: the last window, or all of it.
enum class Span : std::uint8_t { recent, whole };

struct ServiceReading {
  std::string service;
  MeterReading reading;
  std::uint64_t missed = 0;  ///< since the beginning
  bool latest = false;       ///< of Delivery::latest: what is missed was skipped for newer ones
};

/// An object a service, each on a line. Gaps in milliseconds.
[[nodiscard]] std::string json_of(const std::vector<ServiceReading>& readings, Measure measure,
                                  Span span);
/// A table with a row a service.
[[nodiscard]] std::string text_of(const std::vector<ServiceReading>& readings, Measure measure,
                                  Span span, Paint paint = Paint{});

}  // namespace gimnet::tool
