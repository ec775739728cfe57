// Asks adder.cpp for the sum of two numbers, and waits for the answer.

#include <iostream>

#include "gimnet/gimi.hpp"

constexpr gimnet::MessageKey kQuestion{.type = 1, .instance = 0};
constexpr gimnet::MessageKey kAnswer{.type = 2, .instance = 0};
constexpr gimnet::Timeout kPatience{5000};

int main() try {
  const gimnet::Node node;
  // With a window the receiver acknowledges, so that settle() knows whether the question arrived.
  const auto adder = node.sender("adder", {.key = kQuestion, .window = 1}).or_throw();
  adder.send("1.5 2").or_throw();
  adder.settle(kPatience).or_throw();
  const auto answer = node.receive(kAnswer, kPatience).or_throw();
  std::cout << "1.5 + 2 = " << answer.text() << '\n';
  return 0;
} catch (const gimnet::GimnetError& error) {
  std::cerr << "ask: " << error.what() << '\n';
  return 1;
}
