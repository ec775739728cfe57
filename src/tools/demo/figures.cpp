#include "tools/demo/figures.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <numbers>
#include <string_view>

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

namespace {

double degrees(double angle_rad) { return angle_rad * 180.0 / std::numbers::pi; }

// Rows from top to bottom, clipped at the area's end.
class Column {
 public:
  Column(Canvas& canvas, const Area& area) : canvas_(canvas), area_(area), row_(area.corner.row) {}

  [[nodiscard]] int left() const { return area_.corner.column + 1; }
  [[nodiscard]] int right() const { return area_.corner.column + area_.extent.columns - 1; }
  [[nodiscard]] int rows_left() const { return area_.corner.row + area_.extent.rows - row_; }

  void space() { ++row_; }
  void heading(std::string_view title, std::string_view more, Ink ink = Ink::kDim) {
    put(left(), title, Ink::kTitle);
    put_right(right(), more, ink);
    ++row_;
  }
  void heading_over(std::string_view title, std::string_view first, std::string_view second) {
    put(left(), title, Ink::kTitle);
    put_right(right() - 9, first, Ink::kDim);
    put_right(right(), second, Ink::kDim);
    ++row_;
  }
  // A label on the left, one or two figures that end at fixed columns.
  void row(std::string_view label, std::string_view first, std::string_view second,
           Ink ink = Ink::kPlain) {
    put(left(), label, Ink::kLabel);
    put_right(right() - 9, first, ink);
    put_right(right(), second, ink);
    ++row_;
  }
  void curve(const std::vector<std::int64_t>& samples_ns) {
    constexpr char32_t kSteps[] = {U'▁', U'▂', U'▃', U'▄', U'▅', U'▆', U'▇', U'█'};
    std::int64_t most_ns = 1;
    for (const std::int64_t sample_ns : samples_ns) most_ns = std::max(most_ns, sample_ns);
    int column = left();
    for (const std::int64_t sample_ns : samples_ns) {
      const std::int64_t step = std::clamp<std::int64_t>(sample_ns * 8 / (most_ns + 1), 0, 7);
      if (rows_left() > 0) canvas_.put({column, row_}, {kSteps[step], Ink::kScan});
      ++column;
    }
    ++row_;
  }

 private:
  void put(int column, std::string_view text, Ink ink) {
    if (rows_left() > 0) canvas_.text({column, row_}, text, ink);
  }
  void put_right(int end, std::string_view text, Ink ink) {
    put(end - static_cast<int>(decoded_utf8(text).size()), text, ink);
  }

  Canvas& canvas_;
  Area area_;
  int row_;
};

std::string driver_text(const Monitor& monitor, const ScreenState& state) {
  if (monitor.info() && monitor.info()->is_log()) {
    const RobotInfo& info = *monitor.info();
    if (!info.ended) return "recorded";
    // It also ends because the time is up, or the user quits.
    return info.played_s < info.duration_s ? fmt::format("stopped after {:.0f} s", info.played_s)
                                           : "log has ended";
  }
  return state.autopilot ? "autopilot" : "driven by you";
}

void draw_robot_figures(Column& column, const Monitor& monitor, const ScreenState& state) {
  const bool bumped = monitor.odometry() && monitor.odometry()->bumped;
  column.heading("ROBOT", bumped ? "at a wall" : driver_text(monitor, state),
                 bumped ? Ink::kWarn : Ink::kDim);
  const Pose pose = monitor.pose().value_or(Pose{});
  const Twist twist = monitor.odometry().value_or(Odometry{}).twist;
  column.row("x, y", fmt::format("{:.2f}", pose.x_m), fmt::format("{:.2f} m", pose.y_m));
  column.row("heading", "", fmt::format("{:.0f}°", degrees(pose.heading_rad)));
  column.row("speed", fmt::format("{:.2f} m/s", twist.linear_mps),
             fmt::format("{:.0f}°/s", degrees(twist.angular_radps)));
}

void draw_stream_figures(Column& column, const Monitor& monitor, std::int64_t now_ns) {
  column.heading_over("STREAMS", "Hz", "lost");
  const auto stream = [&](std::string_view label, const StreamRecord& record) {
    const std::uint64_t lost = record.missed + record.disordered;
    column.row(label, fmt::format("{:.1f}", record.rate.rate_hz(now_ns)), count_text(lost),
               lost == 0 ? Ink::kPlain : Ink::kBad);
  };
  stream("← odom", monitor.odometry_stream());
  stream("← scan", monitor.scan_stream());
  stream("→ drive", monitor.drive_stream());
}

void draw_latency_figures(Column& column, const Monitor& monitor) {
  column.heading_over("LATENCY", "p50", "p99");
  const auto age = [&](std::string_view label, const StreamRecord& record) {
    column.row(label, duration_text(record.age.percentile_ns(50)),
               duration_text(record.age.percentile_ns(99)));
  };
  age("odom", monitor.odometry_stream());
  age("scan", monitor.scan_stream());
  age("loop", monitor.drive_stream());
  column.curve(monitor.odometry_stream().age.latest(
      static_cast<std::size_t>(column.right() - column.left())));
}

void draw_hub_figures(Column& column, const Monitor& monitor) {
  if (!monitor.hub()) {
    column.heading("HUB", "no counters yet");
    return;
  }
  const HubCounters& hub = *monitor.hub();
  const bool exact = hub.exact();
  column.heading("HUB", exact ? "ledger exact ✓" : "ledger open ✗",
                 exact ? Ink::kGood : Ink::kWarn);
  column.row("accepted", "", count_text(hub.accepted + hub.copies));
  column.row("delivered", "", count_text(hub.delivered));
  column.row("dropped", "", count_text(hub.dropped()), hub.dropped() == 0 ? Ink::kGood : Ink::kBad);
}

void draw_lab(Column& column, std::string_view title, const std::vector<LabsView::Stream>& lab) {
  column.heading_over(title, "Hz", "lost");
  for (const LabsView::Stream& stream : lab) {
    const Ink ink = stream.lost == 0                ? Ink::kPlain
                    : stream.lost == stream.excused ? Ink::kWarn
                                                    : Ink::kBad;
    column.row(stream.name, fmt::format("{:.1f}", stream.rate_hz), count_text(stream.lost), ink);
  }
}

Ink ink_of(LabsView::Wan wan) {
  switch (wan) {
    case LabsView::Wan::cut:
      return Ink::kBad;
    case LabsView::Wan::back:
      return Ink::kWarn;
    case LabsView::Wan::up:
      break;
  }
  return Ink::kGood;
}

void draw_wan(Column& column, const LabsView& labs) {
  column.heading("WAN", labs.wan_text, ink_of(labs.wan));
  column.row("cuts", "", count_text(labs.cuts));
}

}  // namespace

void draw_panel(Canvas& canvas, const Monitor& monitor, const ScreenState& state,
                const Area& area) {
  Column column(canvas, area);
  // Four blocks of 4, 4, 5 and 4 rows; blank rows between them only where all of them fit.
  const bool roomy = area.extent.rows >= 20;
  const auto gap = [&] {
    if (roomy) column.space();
  };
  draw_robot_figures(column, monitor, state);
  gap();
  if (state.labs) {
    draw_lab(column, "NORTH", state.labs->north);
    gap();
    draw_wan(column, *state.labs);
    gap();
    draw_lab(column, "SOUTH", state.labs->south);
  } else {
    draw_stream_figures(column, monitor, state.now_ns);
    gap();
    draw_latency_figures(column, monitor);
  }
  gap();
  draw_hub_figures(column, monitor);
}

void draw_strip(Canvas& canvas, const Monitor& monitor, const ScreenState& state,
                const Area& area) {
  const Pose pose = monitor.pose().value_or(Pose{});
  const Twist twist = monitor.odometry().value_or(Odometry{}).twist;
  const int column = area.corner.column + 1;
  int row = area.corner.row;
  canvas.text({column, row++},
              fmt::format("{:.2f} {:.2f} m  {:.0f}°  {:.2f} m/s  {}", pose.x_m, pose.y_m,
                          degrees(pose.heading_rad), twist.linear_mps, driver_text(monitor, state)),
              Ink::kPlain);
  canvas.text({column, row++},
              fmt::format("odom {:.0f} Hz  scan {:.0f} Hz  p50 {}  p99 {}",
                          monitor.odometry_stream().rate.rate_hz(state.now_ns),
                          monitor.scan_stream().rate.rate_hz(state.now_ns),
                          duration_text(monitor.odometry_stream().age.percentile_ns(50)),
                          duration_text(monitor.odometry_stream().age.percentile_ns(99))),
              Ink::kPlain);
  if (state.labs) {
    canvas.text({column, row}, fmt::format("WAN {}", state.labs->wan_text),
                ink_of(state.labs->wan));
    return;
  }
  if (!monitor.hub()) return;
  const std::uint64_t dropped = monitor.hub()->dropped();
  canvas.text({column, row},
              fmt::format("hub: {} delivered, {} dropped", count_text(monitor.hub()->delivered),
                          count_text(dropped)),
              dropped == 0 ? Ink::kGood : Ink::kBad);
}

}  // namespace gimnet::demo
