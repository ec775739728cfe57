// Watches camera.cpp: viewer [MS], which takes so long for each picture. It always shows the newest
// one, and skips those that came meanwhile.

#include <chrono>
#include <cstdlib>
#include <iostream>
#include <thread>

#include "gimnet/gimi.hpp"

int main(int argc, char** argv) try {
  const std::chrono::milliseconds work{argc > 1 ? std::atoi(argv[1]) : 500};
  const gimnet::Node node;
  const auto images = node.subscribe("camera/images", {.newest_only = true}).or_throw();
  for (;;) {
    const auto picture = images.receive().or_throw();
    std::cout << "picture " << picture.sequence() << ", " << picture.data().size() << " bytes, "
              << images.missed() << " skipped" << std::endl;
    std::this_thread::sleep_for(work);
  }
} catch (const gimnet::GimnetError& error) {
  std::cerr << "viewer: " << error.what() << '\n';
  return 1;
}
