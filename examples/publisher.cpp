// Publishes ten times a second where a robot is: see subscriber.cpp.

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
    // While the hub is away the message is dropped, and publish() says so. The next one is newer.
    if (!sent) std::cerr << "publisher: " << sent.failure().sentence << '\n';
    if (robot.state().ended) return 1;  // no connection will come any more
    std::this_thread::sleep_for(std::chrono::milliseconds(100));
  }
} catch (const gimnet::GimnetError& error) {
  std::cerr << "publisher: " << error.what() << '\n';  // what happened, to what, and what to do
  return 1;
}
