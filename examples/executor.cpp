// A robot with one thread and callbacks: publishes where it is ten times a second, and answers the
// question robot/speed by driving as fast as the question says.

#include <chrono>
#include <cstdlib>
#include <iostream>
#include <string>

#include "gimnet/gimi.hpp"
#include "gimnet/gimi/executor.hpp"

int main() try {
  using std::chrono::milliseconds;
  constexpr milliseconds kPeriod{100};
  const gimnet::Node node("robot");
  const auto pose = node.advertise("pose", {.delivery = gimnet::Delivery::latest}).or_throw();
  const auto speeds = node.answer("speed").or_throw();
  double x = 0;
  double speed = 0;

  gimnet::Executor executor;
  executor
      .on(speeds,
          [&](gimnet::Request request) {
            const std::string text(request.text());
            char* end = nullptr;
            const double asked = std::strtod(text.c_str(), &end);
            if (end == text.c_str()) {
              static_cast<void>(request.fail(1, "'" + text + "' is no speed"));
              return;
            }
            speed = asked;
            static_cast<void>(request.reply("speed " + std::to_string(speed)));
          })
      .or_throw();
  executor.every(kPeriod, [&] {
    x += speed * std::chrono::duration<double>(kPeriod).count();
    pose.publish("x " + std::to_string(x));  // may fail while the hub is away
  });
  executor.run().or_throw();
  return 0;
} catch (const gimnet::GimnetError& error) {
  std::cerr << "executor: " << error.what() << '\n';
  return 1;
}
