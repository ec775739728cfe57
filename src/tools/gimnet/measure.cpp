#include "tools/gimnet/measure.hpp"

#include <algorithm>
#include <cmath>
#include <map>
#include <string>

#include "base/clock.hpp"
#include "tools/gimnet/json_writer.hpp"
#include "tools/gimnet/session.hpp"
#include "tools/gimnet/subscriptions.hpp"
#include "tools/gimnet/table.hpp"

namespace gimnet::tool {
namespace {

double seconds_of(std::int64_t ns) {
  return static_cast<double>(std::max<std::int64_t>(ns, 0)) / 1e9;
}

}  // namespace

void MeterStatistics::add(double value) {
  min_ = count_ == 0 ? value : std::min(min_, value);
  max_ = count_ == 0 ? value : std::max(max_, value);
  ++count_;
  const double from_old_mean = value - mean_;
  mean_ += from_old_mean / static_cast<double>(count_);
  squares_ += from_old_mean * (value - mean_);
}

double MeterStatistics::deviation() const {
  return count_ < 2 ? 0.0 : std::sqrt(std::max(squares_, 0.0) / static_cast<double>(count_));
}

double MeterReading::rate_hz() const {
  return gaps_ms.sum() > 0.0 ? 1000.0 * static_cast<double>(gaps_ms.count()) / gaps_ms.sum() : 0.0;
}

void Meter::count(MeterReading& reading, const Arrival& arrival) {
  reading.sizes_bytes.add(static_cast<double>(arrival.bytes));
  if (arrival.gap_ns >= 0) reading.gaps_ms.add(static_cast<double>(arrival.gap_ns) / 1e6);
}

void Meter::add(std::int64_t at_ns, std::size_t bytes) {
  const bool is_first = whole_.sizes_bytes.count() == 0;
  // A clock that was set back makes no negative gap.
  const Arrival arrival{at_ns, is_first ? -1 : std::max<std::int64_t>(at_ns - last_ns_, 0), bytes};
  last_ns_ = at_ns;
  count(whole_, arrival);
  if (arrivals_.size() == kMessagesMax) arrivals_.pop_front();
  arrivals_.push_back(arrival);
}

MeterReading Meter::recent(std::int64_t now_ns) {
  const std::int64_t from_ns = std::max(begin_ns_, now_ns - window_ns_);
  while (!arrivals_.empty() && arrivals_.front().at_ns < from_ns) arrivals_.pop_front();
  MeterReading reading;
  for (const Arrival& arrival : arrivals_) count(reading, arrival);
  reading.seconds = seconds_of(now_ns - from_ns);
  reading.silent_s = whole(now_ns).silent_s;
  return reading;
}

MeterReading Meter::whole(std::int64_t now_ns) const {
  MeterReading reading = whole_;
  reading.seconds = seconds_of(now_ns - begin_ns_);
  reading.silent_s =
      reading.sizes_bytes.count() == 0 ? reading.seconds : seconds_of(now_ns - last_ns_);
  return reading;
}

namespace {

/// A service that was silent for so much longer than its longest gap is shown as silent.
constexpr double kSilentGaps = 3.0;
constexpr double kSilentLeastS = 1.0;

bool is_silent(const MeterReading& reading) {
  return reading.silent_s >= kSilentLeastS &&
         reading.silent_s * 1000.0 > kSilentGaps * reading.gaps_ms.max();
}

std::string missed_cell(const ServiceReading& one) {
  const bool skipped = one.latest && one.missed != 0;
  return std::to_string(one.missed) + (skipped ? " skipped" : "");
}

std::vector<std::string> rate_cells(const ServiceReading& one) {
  const MeterReading& reading = one.reading;
  const MeterStatistics& gaps = reading.gaps_ms;
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
  const MeterReading& reading = one.reading;
  const MeterStatistics& sizes = reading.sizes_bytes;
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
    const MeterReading& reading = one.reading;
    JsonWriter json;
    json.begin_object().member("service", one.service).member("whole", span == Span::whole);
    json.member("seconds", reading.seconds).member("messages", reading.sizes_bytes.count());
    json.member("missed", one.missed).member("skipped", one.latest ? one.missed : 0);
    json.member("silent_s", reading.silent_s);
    if (measure == Measure::rate) {
      const MeterStatistics& gaps = reading.gaps_ms;
      json.member("rate_hz", reading.rate_hz())
          .member("gap_min_ms", gaps.min())
          .member("gap_mean_ms", gaps.mean());
      json.member("gap_max_ms", gaps.max()).member("gap_std_ms", gaps.deviation());
    } else {
      const MeterStatistics& sizes = reading.sizes_bytes;
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

namespace {

/// The time between two lines.
constexpr std::int64_t kReportNs = 1'000'000'000;
constexpr Timeout kReport{1'000};

/// A meter for each service that is or was there.
class Meters {
 public:
  Meters(ToolSession& session, Measure measure)
      : session_(session),
        subscriptions_(session.node(), session.options().target, kAllMessages),
        measure_(measure),
        window_ns_(std::llround(session.options().window_s * 1e9)) {}

  [[nodiscard]] Outcome<void> open() {
    auto opened = subscriptions_.open();
    if (const std::string words = subscriptions_.waits_for(); opened && !words.empty()) say(words);
    look();
    return opened;
  }

  /// Waits for a message at most so long, and counts it.
  [[nodiscard]] Outcome<void> receive(Timeout timeout) {
    const auto message = subscriptions_.receive(timeout);
    if (!message) return message.failure();
    const std::int64_t begin_ns = message->arrival_ns();
    auto& counted = counted_
                        .try_emplace(std::string(message->service()),
                                     Counted{Meter(begin_ns, window_ns_), 0, false})
                        .first->second;
    counted.meter.add(message->arrival_ns(), message->size());
    counted.latest = message->latest();
    ++messages_;
    return {};
  }

  void print(Span span) {
    look();
    const std::int64_t now_ns = wall_now_ns();
    std::vector<ServiceReading> readings;
    readings.reserve(counted_.size());
    for (auto& [name, counted] : counted_) {
      readings.push_back(
          {name, span == Span::whole ? counted.meter.whole(now_ns) : counted.meter.recent(now_ns),
           counted.missed, counted.latest});
    }
    const bool json = session_.options().json;
    session_.output().write(json ? json_of(readings, measure_, span)
                                 : text_of(readings, measure_, span, session_.paint()));
    session_.output().flush();
  }

  void say_rest() { subscriptions_.say_rest(); }
  [[nodiscard]] std::uint64_t messages() const { return messages_; }

 private:
  struct Counted {
    Meter meter;
    std::uint64_t missed = 0;
    bool latest = false;
  };

  /// Services that are there count from now on, also those that send nothing.
  void look() {
    for (const auto& [name, missed] : subscriptions_.missed()) {
      auto& counted =
          counted_.try_emplace(name, Counted{Meter(wall_now_ns(), window_ns_), 0, false})
              .first->second;
      counted.missed = missed;
    }
  }

  ToolSession& session_;
  Subscriptions subscriptions_;
  Measure measure_;
  std::int64_t window_ns_;
  std::map<std::string, Counted, std::less<>> counted_;
  std::uint64_t messages_ = 0;
};

ExitCode measure(ToolSession& session, Measure measure) {
  if (const auto ending = session.join({})) return *ending;
  Meters meters(session, measure);
  if (const auto opened = meters.open(); !opened) return session.fail(opened.failure());
  const Bounds bounds(session.options());
  ConnectionWatch watch(session.node());
  Failure failure;
  std::int64_t report_ns = steady_now_ns() + kReportNs;
  while (!bounds.enough(meters.messages()) && !bounds.late() && !session.stopped() &&
         session.output().ok()) {
    const std::int64_t left_ns = std::max<std::int64_t>(report_ns - steady_now_ns(), 0);
    const auto received =
        meters.receive(bounds.wait(std::min(kReport, Timeout{left_ns / 1'000'000 + 1})));
    if (!received && !received.is(Status::timeout)) {
      failure = received.failure();
      break;
    }
    if (steady_now_ns() < report_ns) continue;
    watch.look();
    meters.print(Span::recent);
    report_ns = std::max(report_ns + kReportNs, steady_now_ns());
  }
  watch.look_at_end();
  meters.print(Span::whole);
  meters.say_rest();
  if (!failure.sentence.empty() && !session.stopped()) return session.fail(failure);
  return session.finish_stream(bounds, meters.messages());
}

}  // namespace

ExitCode run_hz(ToolSession& session) { return measure(session, Measure::rate); }
ExitCode run_bw(ToolSession& session) { return measure(session, Measure::bytes); }

}  // namespace gimnet::tool
