#include <cmath>
#include <map>
#include <string>

#include "base/clock.hpp"
#include "tools/gimnet/commands.hpp"
#include "tools/gimnet/connection_watch.hpp"
#include "tools/gimnet/meter_report.hpp"
#include "tools/gimnet/subscriptions.hpp"

namespace gimnet::tool {
namespace {

/// How often a line is printed.
constexpr std::int64_t kReportNs = 1'000'000'000;
constexpr Timeout kReport{1'000};

/// A meter for each service that is or was there.
class Meters {
 public:
  Meters(Session& session, Measure measure)
      : session_(session),
        subscriptions_(session.node(), session.options().target),
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

  Session& session_;
  Subscriptions subscriptions_;
  Measure measure_;
  std::int64_t window_ns_;
  std::map<std::string, Counted, std::less<>> counted_;
  std::uint64_t messages_ = 0;
};

ExitCode measure(Session& session, Measure measure) {
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

ExitCode run_hz(Session& session) { return measure(session, Measure::rate); }
ExitCode run_bw(Session& session) { return measure(session, Measure::bytes); }

}  // namespace gimnet::tool
