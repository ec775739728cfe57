#include "tools/demo/viewer.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <utility>

#include "base/clock.hpp"
#include "tools/demo/figures.hpp"
#include "tools/demo/stop_signal.hpp"

namespace gimnet::demo {
namespace {

constexpr std::int64_t kWait_ns = 20'000'000;
constexpr std::int64_t kProgressPeriod_ns = 1'000'000'000;
constexpr double kZoomStep = 1.25;
constexpr double kZoomMax = 20.0;

/// Messages of a stream of which more need not be waited for.
std::uint64_t arrived(const StreamRecord& stream) { return stream.received + stream.excused; }

}  // namespace

Viewer::Viewer(NodePort& port, Terminal* terminal, ViewerOptions options)
    : port_(port),
      terminal_(terminal),
      options_(std::move(options)),
      monitor_(port.now_ns(), !options_.own_robot),
      driver_(options_.autopilot),
      writer_(options_.style) {
  monitor_.excuse_by(options_.excuse);
}

void Viewer::take(const NodePort::Event& event) {
  const auto heard = [&](const auto& message) {
    if (!message) return monitor_.garbled();
    monitor_.take(*message, event.arrival_ns);
  };
  if (event.service == Service::kOdometry) heard(decode<Odometry>(event.payload));
  if (event.service == Service::kScan) heard(decode<Scan>(event.payload));
  if (event.service == Service::kInfo) heard(decode<RobotInfo>(event.payload));
  if (first_heard_ns_ == 0 && monitor_.pose()) first_heard_ns_ = event.arrival_ns;
}

void Viewer::press(Keystroke key, std::int64_t now_ns) {
  switch (key) {
    case Keystroke::kQuit:
      quit_ = true;
      break;
    case Keystroke::kHelp:
      help_ = !help_;
      break;
    case Keystroke::kTrail:
      map_.trail = !map_.trail;
      break;
    case Keystroke::kFollow:
      map_.follow = !map_.follow;
      break;
    case Keystroke::kZoomIn:
      map_.zoom = std::min(map_.zoom * kZoomStep, kZoomMax);
      break;
    case Keystroke::kZoomOut:
      map_.zoom = std::max(map_.zoom / kZoomStep, 1.0);
      break;
    case Keystroke::kFit:
      map_ = MapChoice{};
      break;
    case Keystroke::kRedraw:
      writer_.redraw();
      break;
    default:
      driver_.press(key, monitor_, now_ns);
      break;
  }
  next_frame_ns_ = std::min(next_frame_ns_, now_ns);
}

void Viewer::take_keys(std::int64_t now_ns) {
  if (terminal_ == nullptr) return;
  std::string bytes;
  if (!terminal_->read(bytes)) quit_ = true;
  for (const Keystroke key : keys_in(bytes)) press(key, now_ns);
}

ScreenState Viewer::screen_state(std::int64_t now_ns) const {
  ScreenState state{map_,  options_.hub_url,  now_ns, driver_.autopilot(),
                    help_, port_.connected(), {}};
  if (options_.labs) state.labs = options_.labs(now_ns);
  return state;
}

void Viewer::draw(std::int64_t now_ns) {
  if (terminal_ == nullptr || now_ns < next_frame_ns_) return;
  next_frame_ns_ = now_ns + kFramePeriod_ns;
  terminal_->write(
      writer_.update(draw_screen(monitor_, screen_state(now_ns), terminal_->extent())));
}

void Viewer::report_progress(std::int64_t now_ns) {
  if (!options_.on_progress || now_ns < next_progress_ns_ || first_heard_ns_ == 0) return;
  next_progress_ns_ = now_ns + kProgressPeriod_ns;
  const Pose pose = monitor_.pose().value_or(Pose{});
  options_.on_progress(fmt::format(
      "{:>6.1f} s  odom {:5.1f} Hz  scan {:5.1f} Hz  p50 {}  p99 {}  at {:.2f} {:.2f} m  dropped "
      "{}",
      static_cast<double>(now_ns - first_heard_ns_) * 1e-9,
      monitor_.odometry_stream().rate.rate_hz(now_ns), monitor_.scan_stream().rate.rate_hz(now_ns),
      duration_text(monitor_.odometry_stream().age.percentile_ns(50)),
      duration_text(monitor_.odometry_stream().age.percentile_ns(99)), pose.x_m, pose.y_m,
      monitor_.hub() ? count_text(monitor_.hub()->dropped()) : "?"));
}

std::optional<Error> Viewer::step(std::int64_t wait_ns) {
  const Result<std::optional<NodePort::Event>> event = port_.receive(wait_ns);
  const std::int64_t now_ns = port_.now_ns();
  if (!event) return event.error();
  if (*event) take(**event);
  while (const std::optional<DriveCommand> command = driver_.next(monitor_, now_ns)) {
    const Result<bool> sent = port_.command(encode(*command));
    if (!sent) return sent.error();
    if (!*sent) break;
    monitor_.sent(*command, now_ns);
    ++commands_;
    if (options_.excuse && options_.excuse(now_ns)) ++commands_excused_;
  }
  take_keys(now_ns);
  if (now_ns >= next_counters_ns_) {
    next_counters_ns_ = now_ns + kCountersPeriod_ns;
    if (const std::optional<HubCounters> counters = port_.hub_counters()) monitor_.take(*counters);
  }
  if (options_.on_look) options_.on_look(monitor_, now_ns);
  draw(now_ns);
  report_progress(now_ns);
  return options_.trouble ? options_.trouble(0) : std::nullopt;
}

bool Viewer::time_is_over() const {
  if (options_.over && options_.over()) return true;
  const bool unattended = terminal_ == nullptr || options_.seconds;
  if (unattended && monitor_.info() && monitor_.info()->ended) return true;
  if (!options_.seconds || first_heard_ns_ == 0) return false;
  return static_cast<double>(port_.now_ns() - first_heard_ns_) * 1e-9 >= *options_.seconds;
}

std::optional<Error> Viewer::run() {
  std::optional<Error> error = watch();
  if (!error) return std::nullopt;
  if (ended_ns_ == 0) ended_ns_ = port_.now_ns();
  // The connection notices the end of a process before the process is seen to end, and knows less.
  if (std::optional<Error> why = options_.trouble ? options_.trouble(kWhy_ns) : std::nullopt)
    error = why;
  broken_ = error->sentence;
  return error;
}

std::optional<Error> Viewer::watch() {
  const std::int64_t start_ns = steady_now_ns();
  while (!quit_ && stop_signal() == 0 && !time_is_over()) {
    if (std::optional<Error> error = step(kWait_ns)) return error;
    const bool impatient = options_.own_robot || options_.seconds.has_value();
    if (impatient && first_heard_ns_ == 0 && steady_now_ns() - start_ns > kFirstSign_ns) {
      return Error{
          fmt::format("no robot was heard at {} within {} s; is it running there, under that name?",
                      options_.hub_url, kFirstSign_ns / 1'000'000'000)};
    }
  }
  ended_ns_ = port_.now_ns();
  return finish();
}

bool Viewer::everything_arrived() const {
  const std::optional<RobotInfo>& info = monitor_.info();
  if (!info || !info->ended) return false;
  const std::uint64_t lost = commands_ - std::min(commands_, info->drive_total);
  return lost <= commands_excused_ && arrived(monitor_.odometry_stream()) >= info->odometry_total &&
         arrived(monitor_.scan_stream()) >= info->scan_total;
}

// Tells an own robot to say no more, waits for what it said before, and then for a hub in which
// nothing moves.
std::optional<Error> Viewer::finish() {
  const std::int64_t until_ns = steady_now_ns() + kFinish_ns;
  if (options_.own_robot && monitor_.info()) {
    driver_.finish();
    while (steady_now_ns() < until_ns) {
      if (std::optional<Error> error = step(kWait_ns)) return error;
      if (!everything_arrived()) continue;
      finished_ = true;
      break;
    }
  }
  while (true) {
    if (const std::optional<HubCounters> counters = port_.hub_counters()) monitor_.take(*counters);
    const bool settled = monitor_.hub() && monitor_.hub()->exact() && monitor_.hub()->queued == 0;
    if (!options_.own_robot || settled || steady_now_ns() >= until_ns) return std::nullopt;
    if (const auto event = port_.receive(kWait_ns); !event) return event.error();
  }
}

RunRecord Viewer::record() const {
  const std::int64_t end_ns = ended_ns_ != 0 ? ended_ns_ : port_.now_ns();
  const double seconds =
      first_heard_ns_ == 0 ? 0.0 : static_cast<double>(end_ns - first_heard_ns_) * 1e-9;
  return {options_.hub_url,   seconds, commands_,        driver_.corners_reached(), finished_,
          options_.own_robot, broken_, commands_excused_};
}

std::string Viewer::last_picture(Extent extent) const {
  return writer_.lines(draw_screen(monitor_, screen_state(ended_ns_), extent));
}

}  // namespace gimnet::demo
