// Drives robot.cpp from afar and shows where it is and what it sees: pilot [SPEED TURN [SECONDS]]

#include <chrono>
#include <cstdlib>
#include <iostream>
#include <string>

#include "gimnet/gimi.hpp"

using Clock = std::chrono::steady_clock;

int main(int argc, char** argv) try {
  const std::string command =
      argc > 2 ? std::string(argv[1]) + " " + argv[2] : std::string("0.5 0.1");
  const auto end = Clock::now() + std::chrono::seconds{argc > 3 ? std::atoi(argv[3]) : 5};

  const gimnet::Node node("pilot");
  const auto poses = node.subscribe("robot/pose").or_throw();
  const auto pictures = node.subscribe("robot/camera", {.newest_only = true}).or_throw();
  if (!poses.wait_until_exists(gimnet::Timeout{5000})) {
    std::cerr << "pilot: there is no robot/pose: start robot first\n";
    return 1;
  }
  const auto drive = node.sender("robot/drive").or_throw();
  while (Clock::now() < end) {
    // The robot stops by itself if commands no longer reach it, so each is sent again and again.
    if (const auto sent = drive.send(command, gimnet::Timeout{100}); !sent)
      std::cerr << "pilot: " << sent.failure().sentence << '\n';
    if (const auto pose = poses.receive(gimnet::Timeout{200}))
      std::cout << pose->text() << std::endl;
    else
      std::cerr << "pilot: " << pose.failure().sentence << '\n';
    if (const auto picture = pictures.try_receive())
      std::cout << "picture " << picture->sequence() << ", " << picture->data().size() << " bytes"
                << std::endl;
  }
} catch (const gimnet::GimnetError& error) {
  std::cerr << "pilot: " << error.what() << '\n';
  return 1;
}
