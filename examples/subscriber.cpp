// Prints what publisher.cpp says. It may be started first, and goes on when the publisher or the
// hub was away.

#include <iostream>

#include "gimnet/gimi.hpp"

int main() try {
  const gimnet::Node viewer;  // without a name: nobody has to find it
  const auto odometry = viewer.subscribe("robot/odom").or_throw();
  for (;;) {
    const auto message = odometry.receive().or_throw();
    std::cout << message.from().text() << " #" << message.sequence() << ": " << message.text()
              << std::endl;
  }
} catch (const gimnet::GimnetError& error) {
  std::cerr << "subscriber: " << error.what() << '\n';
  return 1;
}
