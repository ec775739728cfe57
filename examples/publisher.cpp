// Says ten times a second where a robot is, to all who want to know: see subscriber.cpp.

#include <chrono>
#include <iostream>
#include <string>
#include <thread>

#include "gimnet/gimi.hpp"

int main() try {
  const gimnet::Node robot("robot");  // joins by the hub of this machine, or of GIMNET_HUB
  const auto odometry = robot.advertise("odom").or_throw();  // its full name is robot/odom
  for (int step = 0;; ++step) {
    const auto sent = odometry.publish("x " + std::to_string(0.1 * step) + " y 0");
    // A hub that is away for a while is no reason to stop: what comes next is newer.
    if (!sent.is(gimnet::Status::timeout)) sent.or_throw();
    std::this_thread::sleep_for(std::chrono::milliseconds(100));
  }
} catch (const gimnet::GimnetError& error) {
  std::cerr << "publisher: " << error.what() << '\n';  // what happened, to what, and what to do
  return 1;
}
