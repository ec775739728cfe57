#include "tools/gimnet/meter_report.hpp"

#include <cmath>

#include "tools/gimnet/decimal.hpp"
#include "tools/gimnet/json_writer.hpp"
#include "tools/gimnet/table.hpp"

namespace gimnet::tool {
namespace {

/// A service that was silent for so much longer than its longest gap is shown as silent.
constexpr double kSilentGaps = 3.0;
constexpr double kSilentLeastS = 1.0;

bool is_silent(const Reading& reading) {
  return reading.silent_s >= kSilentLeastS &&
         reading.silent_s * 1000.0 > kSilentGaps * reading.gaps_ms.max();
}

std::string missed_cell(const ServiceReading& one) {
  const bool skipped = one.latest && one.missed != 0;
  return std::to_string(one.missed) + (skipped ? " skipped" : "");
}

std::vector<std::string> rate_cells(const ServiceReading& one) {
  const Reading& reading = one.reading;
  const Statistics& gaps = reading.gaps_ms;
  const auto gap = [&](double value) {
    return gaps.count() == 0 ? std::string("-") : decimal(value, 3);
  };
  return {one.service,
          decimal(reading.rate_hz(), 1),
          gap(gaps.min()),
          gap(gaps.mean()),
          gap(gaps.max()),
          gap(gaps.deviation()),
          std::to_string(reading.sizes_bytes.count()),
          missed_cell(one)};
}

std::vector<std::string> byte_cells(const ServiceReading& one) {
  const Reading& reading = one.reading;
  const Statistics& sizes = reading.sizes_bytes;
  const auto size = [&](double value) {
    return sizes.count() == 0 ? std::string("-") : byte_count(value);
  };
  return {one.service,
          byte_count(reading.bytes_per_s()) + "/s",
          size(sizes.min()),
          size(sizes.mean()),
          size(sizes.max()),
          byte_count(sizes.sum()),
          std::to_string(sizes.count()),
          missed_cell(one)};
}

}  // namespace

std::string json_of(const std::vector<ServiceReading>& readings, Measure measure, Span span) {
  std::string lines;
  for (const ServiceReading& one : readings) {
    const Reading& reading = one.reading;
    JsonWriter json;
    json.begin_object().member("service", one.service).member("whole", span == Span::whole);
    json.member("seconds", reading.seconds).member("messages", reading.sizes_bytes.count());
    json.member("missed", one.missed).member("skipped", one.latest ? one.missed : 0);
    json.member("silent_s", reading.silent_s);
    if (measure == Measure::rate) {
      const Statistics& gaps = reading.gaps_ms;
      json.member("rate_hz", reading.rate_hz())
          .member("gap_min_ms", gaps.min())
          .member("gap_mean_ms", gaps.mean());
      json.member("gap_max_ms", gaps.max()).member("gap_std_ms", gaps.deviation());
    } else {
      const Statistics& sizes = reading.sizes_bytes;
      json.member("bytes_per_s", reading.bytes_per_s()).member("bytes", std::llround(sizes.sum()));
      json.member("size_min", std::llround(sizes.min())).member("size_mean", sizes.mean());
      json.member("size_max", std::llround(sizes.max()));
    }
    lines += json.end_object().str() + "\n";
  }
  return lines;
}

std::string text_of(const std::vector<ServiceReading>& readings, Measure measure, Span span,
                    Paint paint) {
  if (readings.empty()) return {};
  const bool is_rate = measure == Measure::rate;
  Table table(is_rate ? std::vector<std::string>{"SERVICE", "HZ", "GAP MIN", "MEAN", "MAX",
                                                 "STD ms", "MESSAGES", "MISSED"}
                      : std::vector<std::string>{"SERVICE", "BYTES/S", "SIZE MIN", "MEAN", "MAX",
                                                 "SUM", "MESSAGES", "MISSED"});
  for (const ServiceReading& one : readings) {
    table.add(is_rate ? rate_cells(one) : byte_cells(one),
              is_silent(one.reading) ? Tone::warning : Tone::plain);
  }
  std::string text =
      span == Span::whole ? "in all " + decimal(readings.front().reading.seconds, 1) + " s:\n" : "";
  return text + table.text(paint);
}

}  // namespace gimnet::tool
