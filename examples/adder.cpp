// Answers questions: adds the numbers of each question. See ask.cpp.

#include <iostream>
#include <sstream>
#include <string>

#include "gimnet/gimi.hpp"

int main() try {
  const gimnet::Node node("calc");
  const auto add = node.answer("add").or_throw();  // its full name is calc/add
  for (;;) {
    auto question = add.receive().or_throw();  // throws when no connection will come any more
    std::istringstream numbers{std::string(question.text())};
    double sum = 0.0;
    for (double number = 0.0; numbers >> number;) sum += number;
    const auto sent = numbers.eof() ? question.reply(std::to_string(sum))
                                    : question.fail(1, "these are not only numbers");
    // The program that asked may be gone: the next question may be another one's.
    if (!sent) std::cerr << "adder: " << sent.failure().sentence << '\n';
  }
} catch (const gimnet::GimnetError& error) {
  std::cerr << "adder: " << error.what() << '\n';
  return 1;
}
