// A robot to drive from afar: takes commands, gives its pose and pictures. See pilot.cpp.
// A command is a text, `SPEED TURN`, in m/s and rad/s. Half a second without one stops the robot.

#include <chrono>
#include <cmath>
#include <cstdio>
#include <iostream>
#include <string>
#include <vector>

#include "gimnet/gimi.hpp"

using Clock = std::chrono::steady_clock;
using Seconds = std::chrono::duration<double>;
constexpr gimnet::Timeout kPeriod{50};
constexpr gimnet::Timeout kDeadMan{500};
constexpr gimnet::Timeout kPicturePeriod{200};

struct Robot {
  double x = 0, y = 0, heading = 0, speed = 0, turn = 0;

  void obey(std::string_view command) {
    std::sscanf(std::string(command).c_str(), "%lf %lf", &speed, &turn);
  }
  void move(double seconds) {
    heading += turn * seconds;
    x += speed * std::cos(heading) * seconds;
    y += speed * std::sin(heading) * seconds;
  }
  [[nodiscard]] std::string pose() const {
    return "x " + std::to_string(x) + " y " + std::to_string(y) + " heading " +
           std::to_string(heading);
  }
};

int main() try {
  const gimnet::Node node("robot");
  // Only the newest command, pose and picture count: what is older never waits before them.
  const auto drive = node.accept("drive", {.queue = {.messages = 1}}).or_throw();
  const auto pose = node.advertise("pose", {.delivery = gimnet::Delivery::latest}).or_throw();
  const auto camera =
      node.advertise("camera", {.delivery = gimnet::Delivery::latest, .lane = gimnet::Lane::bulk})
          .or_throw();
  Robot robot;
  auto moved = Clock::now(), commanded = moved, pictured = moved;
  while (!node.state().ended) {
    const auto command = drive.receive(kPeriod);  // the period of the loop, or a command at once
    const auto now = Clock::now();
    robot.move(Seconds(now - moved).count());
    moved = now;
    if (command) {
      robot.obey(command->text());
      commanded = now;
    } else if (now - commanded > kDeadMan) {
      robot.obey("0 0");
    }
    pose.publish(robot.pose());
    // A camera that nobody watches rests.
    if (camera.subscribers() > 0 && now - pictured > kPicturePeriod) {
      pictured = now;
      camera.publish(std::vector<unsigned char>(320 * 240, static_cast<unsigned char>(robot.x)));
    }
  }
  return 1;
} catch (const gimnet::GimnetError& error) {
  std::cerr << "robot: " << error.what() << '\n';
  return 1;
}
