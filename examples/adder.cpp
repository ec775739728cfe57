// Answers questions: adds the numbers that somebody sends, and sends the sum back. See ask.cpp.

#include <iostream>
#include <sstream>
#include <string>

#include "gimnet/gimi.hpp"

// What a message is, in numbers of the application's own. Each has a queue of its own at its
// receiver.
constexpr gimnet::MessageKey kQuestion{.type = 1, .instance = 0};
constexpr gimnet::MessageKey kAnswer{.type = 2, .instance = 0};

int main() try {
  const gimnet::Node node("adder");
  for (;;) {
    const auto question = node.receive(kQuestion).or_throw();
    std::istringstream numbers{std::string(question.text())};
    double sum = 0.0;
    for (double number = 0.0; numbers >> number;) sum += number;
    const auto sent = node.send(question.from(), std::to_string(sum), {.key = kAnswer});
    if (!sent)
      std::cerr << "adder: " << sent.failure().sentence << '\n';  // who asked may be gone: go on
  }
} catch (const gimnet::GimnetError& error) {
  std::cerr << "adder: " << error.what() << '\n';
  return 1;
}
