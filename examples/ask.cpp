// Asks adder.cpp for the sum of each line of standard input: echo 1.5 2 | ask

#include <iostream>
#include <string>

#include "gimnet/gimi.hpp"

constexpr gimnet::MessageKey kQuestion{.type = 1, .instance = 0};
constexpr gimnet::MessageKey kAnswer{.type = 2, .instance = 0};
constexpr gimnet::Timeout kPatience{5000};

// Sends one question and waits for its answer. An answer repeats the number of its question, so
// that one that comes too late is not taken for the answer to the next question.
gimnet::Outcome<std::string> ask(const gimnet::Node& node, int number,
                                 const std::string& summands) {
  const std::string head = std::to_string(number) + " ";
  const auto sent = node.send("adder", head + summands, {.key = kQuestion}, kPatience);
  if (!sent) return sent.failure();
  for (;;) {
    const auto answer = node.receive(kAnswer, kPatience);
    if (!answer) return answer.failure();
    if (answer->text().starts_with(head)) return std::string(answer->text().substr(head.size()));
  }
}

int main() try {
  const gimnet::Node node;
  int failed = 0;
  std::string summands;
  for (int number = 1; std::getline(std::cin, summands); ++number) {
    const auto sum = ask(node, number, summands);
    if (sum) {
      std::cout << summands << ": " << *sum << std::endl;
      continue;
    }
    // The hub or the adder may be back at the next question.
    std::cerr << "ask: " << summands << ": " << sum.failure().sentence << '\n';
    failed = 1;
  }
  return failed;
} catch (const gimnet::GimnetError& error) {
  std::cerr << "ask: " << error.what() << '\n';
  return 1;
}
