// Answers questions: adds the numbers of each question and sends back the sum. See ask.cpp.

#include <iostream>
#include <sstream>
#include <string>

#include "gimnet/gimi.hpp"

// The application's own numbers for its messages. Each key has a queue of its own at its receiver.
constexpr gimnet::MessageKey kQuestion{.type = 1, .instance = 0};
constexpr gimnet::MessageKey kAnswer{.type = 2, .instance = 0};

int main() try {
  const gimnet::Node node("adder");
  for (;;) {
    const auto question = node.receive(kQuestion).or_throw();
    std::istringstream words{std::string(question.text())};
    std::string number;  // of the question; the answer repeats it
    words >> number;
    double sum = 0.0;
    for (double summand = 0.0; words >> summand;) sum += summand;
    const auto sent =
        node.send(question.from(), number + " " + std::to_string(sum), {.key = kAnswer});
    // The node that asked may be gone: the next question may be another node's.
    if (!sent) std::cerr << "adder: " << sent.failure().sentence << '\n';
  }
} catch (const gimnet::GimnetError& error) {
  std::cerr << "adder: " << error.what() << '\n';
  return 1;
}
