// Prints the messages of publisher.cpp. It may be started first, and goes on when the publisher or
// the hub was away.

#include <iostream>

#include "gimnet/gimi.hpp"

int main() try {
  const gimnet::Node viewer;  // without a name: nobody has to find it
  const auto odometry = viewer.subscribe("robot/odom").or_throw();
  for (;;) {
    const auto message = odometry.receive().or_throw();  // throws when no connection will come
    std::cout << message.from().text() << " #" << message.sequence() << ": " << message.text()
              << std::endl;
  }
} catch (const gimnet::GimnetError& error) {
  std::cerr << "subscriber: " << error.what() << '\n';
  return 1;
}
