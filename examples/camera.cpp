// A camera with 30 pictures a second, which rests while nobody watches. See viewer.cpp.

#include <chrono>
#include <iostream>
#include <thread>
#include <vector>

#include "gimnet/gimi.hpp"

constexpr int kWidth = 640, kHeight = 480;
using Picture = std::vector<unsigned char>;

// A bright line that moves down, a picture after the other.
static void take(Picture& picture, int number) {
  const int line = number % kHeight;
  for (int i = 0; i < kWidth * kHeight; ++i) picture[i] = i / kWidth == line ? 255 : 32;
}

int main() try {
  const gimnet::Node node("camera");
  // Only the newest picture waits for a slow viewer. Commands and poses overtake pictures in bulk.
  const auto images =
      node.advertise("images", {.delivery = gimnet::Delivery::latest, .lane = gimnet::Lane::bulk})
          .or_throw();
  Picture picture(kWidth * kHeight);
  for (int number = 0; !node.state().ended; ++number) {
    if (images.subscribers() == 0) {
      std::cout << "camera: nobody watches" << std::endl;
      images.wait_for_subscribers(1).or_throw();
      std::cout << "camera: somebody watches" << std::endl;
    }
    take(picture, number);
    images.publish(picture);
    std::this_thread::sleep_for(std::chrono::milliseconds(33));
  }
  return 1;
} catch (const gimnet::GimnetError& error) {
  std::cerr << "camera: " << error.what() << '\n';
  return 1;
}
