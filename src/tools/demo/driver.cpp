#include "tools/demo/driver.hpp"

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <iterator>
#include <optional>
#include <span>

#include "tools/demo/log_player.hpp"

namespace gimnet::demo {

namespace {

constexpr char kEscape = '\x1b';

struct Meaning {
  std::string_view bytes;  // each of which means it
  Keystroke key;
};

constexpr Meaning kMeanings[] = {
    {"wW", Keystroke::kForward},     {"sS", Keystroke::kBack},   {"aA", Keystroke::kLeft},
    {"dD", Keystroke::kRight},       {" ", Keystroke::kStop},    {"]>.", Keystroke::kFaster},
    {"[<,", Keystroke::kSlower},     {"+=", Keystroke::kZoomIn}, {"-_", Keystroke::kZoomOut},
    {"0", Keystroke::kFit},          {"fF", Keystroke::kFollow}, {"tT", Keystroke::kTrail},
    {"pP", Keystroke::kAutopilot},   {"hH?", Keystroke::kHelp},  {"\x0c", Keystroke::kRedraw},
    {"qQ\x03\x04", Keystroke::kQuit}};
constexpr Meaning kArrows[] = {{"A", Keystroke::kForward},
                               {"B", Keystroke::kBack},
                               {"C", Keystroke::kRight},
                               {"D", Keystroke::kLeft}};

std::optional<Keystroke> key_in(std::span<const Meaning> meanings, char byte) {
  for (const Meaning& meaning : meanings) {
    if (meaning.bytes.find(byte) != std::string_view::npos) return meaning.key;
  }
  return std::nullopt;
}

// Bytes of the sequence at the front of a text that begins with Esc: CSI or SS3 (ECMA-48, 5.4 and
// 8.3.143). A control character is in none of them: it is a key of its own, as is what stands
// behind an Esc that begins neither.
std::size_t sequence_size(std::string_view text) {
  if (text.size() < 2 || (text[1] != '[' && text[1] != 'O')) return 1;
  for (std::size_t index = 2; index < text.size(); ++index) {
    const char byte = text[index];
    if (byte < ' ' || byte > '~') return index;
    // F1 to F5 of the Linux console: ESC [ [ A.
    const bool second_bracket = text[1] == '[' && index == 2 && byte == '[';
    if (text[1] == 'O' || (byte >= '@' && !second_bracket)) return index + 1;
  }
  return text.size();
}

std::optional<Keystroke> key_of_sequence(std::string_view sequence) {
  if (sequence.size() < 3 || sequence[2] == '[') return std::nullopt;
  return key_in(kArrows, sequence.back());
}

}  // namespace

std::vector<Keystroke> keys_in(std::string_view bytes) {
  std::vector<Keystroke> keys;
  while (!bytes.empty()) {
    const bool escape = bytes.front() == kEscape;
    const std::size_t size = escape ? sequence_size(bytes) : 1;
    const std::optional<Keystroke> key =
        escape ? key_of_sequence(bytes.substr(0, size)) : key_in(kMeanings, bytes.front());
    if (key) keys.push_back(*key);
    bytes.remove_prefix(size);
  }
  return keys;
}

void Teleop::press(Keystroke key, std::int64_t now_ns) {
  switch (key) {
    case Keystroke::kForward:
    case Keystroke::kBack:
      linear_ = key == Keystroke::kForward ? kLinear_mps : -kLinear_mps / 2.0;
      linear_until_ns_ = now_ns + kHoldLinear_ns;
      break;
    case Keystroke::kLeft:
    case Keystroke::kRight:
      angular_ = key == Keystroke::kLeft ? kAngular_radps : -kAngular_radps;
      angular_until_ns_ = now_ns + kHoldAngular_ns;
      break;
    case Keystroke::kStop:
      linear_until_ns_ = angular_until_ns_ = now_ns;
      break;
    default:
      break;
  }
}

Twist Teleop::twist(std::int64_t now_ns) const {
  return {now_ns < linear_until_ns_ ? linear_ : 0.0, now_ns < angular_until_ns_ ? angular_ : 0.0};
}

namespace {

constexpr double kReached_m = 0.35;
constexpr double kCruise_mps = 1.0;
constexpr double kTurnGain_per_s = 2.5;
constexpr double kTurnMax_radps = 1.8;
// Beyond this angle it turns on the spot.
constexpr double kTurnFirst_rad = 0.9;

}  // namespace

Twist Course::steer(const Pose& pose) {
  if (corners_.empty()) return {};
  if (distance_m(position(pose), corners_[next_]) < kReached_m) {
    next_ = (next_ + 1) % corners_.size();
    ++reached_;
  }
  const Point& target = corners_[next_];
  const double direction_rad = std::atan2(target.y_m - pose.y_m, target.x_m - pose.x_m);
  const double error_rad = normalized_angle(direction_rad - pose.heading_rad);
  const double ahead = std::max(0.0, 1.0 - std::abs(error_rad) / kTurnFirst_rad);
  return {kCruise_mps * ahead,
          std::clamp(kTurnGain_per_s * error_rad, -kTurnMax_radps, kTurnMax_radps)};
}

namespace {

constexpr double kSpeeds[] = {kPlaySpeedMin, 0.25, 0.5,  1.0,  2.0,
                              5.0,           10.0, 20.0, 50.0, kPlaySpeedMax};

double faster_than(double speed) {
  const double* next = std::upper_bound(std::begin(kSpeeds), std::end(kSpeeds), speed);
  return next == std::end(kSpeeds) ? kPlaySpeedMax : *next;
}

double slower_than(double speed) {
  const double* same = std::lower_bound(std::begin(kSpeeds), std::end(kSpeeds), speed);
  return same == std::begin(kSpeeds) ? kPlaySpeedMin : *std::prev(same);
}

bool plays_log(const Monitor& monitor) { return monitor.info() && monitor.info()->is_log(); }

}  // namespace

void Driver::change_speed(double speed) {
  speed_ = speed;
  changed_ = true;
}

void Driver::press(Keystroke key, const Monitor& monitor, std::int64_t now_ns) {
  if (plays_log(monitor)) {
    const double speed = speed_.value_or(monitor.info()->speed);
    if (key == Keystroke::kFaster) change_speed(faster_than(speed));
    if (key == Keystroke::kSlower) change_speed(slower_than(speed));
    if (key == Keystroke::kStop) {
      paused_ = !paused_;
      changed_ = true;
    }
    return;
  }
  if (key == Keystroke::kAutopilot) autopilot_ = !autopilot_;
  const bool drives = key == Keystroke::kForward || key == Keystroke::kBack ||
                      key == Keystroke::kLeft || key == Keystroke::kRight ||
                      key == Keystroke::kStop;
  // A key takes the wheel from the course.
  if (drives) autopilot_ = false;
  teleop_.press(key, now_ns);
}

Twist Driver::wanted(const Monitor& monitor, std::int64_t now_ns) {
  if (!autopilot_) return teleop_.twist(now_ns);
  if (!course_ && monitor.plan()) course_.emplace(monitor.plan()->waypoints());
  if (!course_ || !monitor.odometry()) return {};
  return course_->steer(monitor.odometry()->pose);
}

std::optional<DriveCommand> Driver::next(const Monitor& monitor, std::int64_t now_ns) {
  if (finish_said_ || !monitor.info()) return std::nullopt;
  const bool due = plays_log(monitor) ? changed_ : now_ns >= next_ns_;
  if (!due && !finish_) return std::nullopt;
  next_ns_ = std::max(next_ns_ + kPeriod_ns, now_ns - kPeriod_ns);
  changed_ = false;
  finish_said_ = finish_;
  DriveCommand command;
  command.stamp = {++number_, now_ns};
  command.speed = speed_.value_or(monitor.info()->speed);
  command.paused = paused_;
  command.finish = finish_;
  if (!finish_ && !plays_log(monitor)) command.twist = wanted(monitor, now_ns);
  return command;
}

}  // namespace gimnet::demo
