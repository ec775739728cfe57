#include "tools/demo/robot.hpp"

#include <algorithm>

namespace gimnet::demo {

void Robot::publish(Service service, const Bytes& bytes) {
  if (!error_) error_ = port_.publish(service, bytes);
}

void Robot::publish_info(std::int64_t now_ns) {
  RobotInfo info = source_->info();
  info.stamp = {++info_total_, now_ns};
  info.ended = info.ended || finish_;
  info.odometry_total = odometry_total_;
  info.scan_total = scan_total_;
  info.drive_total = drive_total_;
  said_ended_ = info.ended;
  next_info_ns_ = now_ns + kInfoPeriod_ns;
  publish(Service::kInfo, encode(info));
}

void Robot::handle(const NodePort::Event& event, std::int64_t now_ns) {
  if (event.service != Service::kDrive) return;
  const std::optional<DriveCommand> command = decode<DriveCommand>(event.payload);
  if (!command) return;
  ++drive_total_;
  finish_ = finish_ || command->finish;
  if (source_) source_->handle(*command, now_ns);
}

std::int64_t Robot::wait_ns(std::int64_t now_ns) const {
  if (!source_ || finished_) return kWait_ns;
  const std::int64_t due_ns = finish_ ? now_ns : std::min(source_->next_due_ns(), next_info_ns_);
  return std::clamp<std::int64_t>(due_ns - now_ns, 0, kWait_ns);
}

std::optional<Error> Robot::step() {
  const Result<std::optional<NodePort::Event>> event = port_.receive(wait_ns(port_.now_ns()));
  if (!event) return event.error();
  const std::int64_t now_ns = port_.now_ns();
  if (*event) handle(**event, now_ns);
  if (!source_) {
    if (!port_.heard()) return std::nullopt;
    source_ = make_source_(now_ns);
    publish_info(now_ns);
  }
  if (finished_) return error_;
  if (!finish_) {
    source_->advance(now_ns, {[this, now_ns](Odometry message) {
                                message.stamp = {++odometry_total_, now_ns};
                                publish(Service::kOdometry, encode(message));
                              },
                              [this, now_ns](Scan message) {
                                message.stamp = {++scan_total_, now_ns};
                                publish(Service::kScan, encode(message));
                              }});
  }
  const bool ends_now = !said_ended_ && (finish_ || source_->info().ended);
  if (ends_now || finish_ || now_ns >= next_info_ns_) publish_info(now_ns);
  finished_ = finish_;
  return error_;
}

}  // namespace gimnet::demo
