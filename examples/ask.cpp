// Asks adder.cpp for the sum of each line of standard input: echo 1.5 2 | ask

#include <iostream>
#include <string>

#include "gimnet/gimi.hpp"

int main() try {
  const gimnet::Node node;
  int failed = 0;
  for (std::string numbers; std::getline(std::cin, numbers);) {
    // One of many ends: a reply, nobody answers there, no reply within two seconds, ...
    const auto reply = node.request("calc/add", numbers, gimnet::Timeout{2000});
    if (reply) {
      std::cout << numbers << ": " << reply.text() << std::endl;
      continue;
    }
    std::cerr << "ask: " << numbers << ": " << reply.failure().sentence << '\n';
    // If the work may have been done, a program that pays or opens a door asks again with care.
    if (reply.ran() != gimnet::Ran::no) std::cerr << "ask: calc may have added them\n";
    failed = 1;
  }
  return failed;
} catch (const gimnet::GimnetError& error) {
  std::cerr << "ask: " << error.what() << '\n';
  return 1;
}
