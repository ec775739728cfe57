#pragma once

#include <stdexcept>
#include <string>
#include <thread>

#include "gimnet/gimi.hpp"

// The use that a program and its plugin make of GIMI in C++.

inline void expect(bool condition, const char* what) {
  if (!condition) throw std::runtime_error(what);
}

/// Publishes, receives, asks and answers under that name. Throws what went wrong.
inline void use_gimnet(const char* hub, const std::string& name) {
  using namespace gimnet;
  constexpr Timeout kWait{20'000};
  const Node node(name, hub);
  const auto publisher = node.advertise("odom").or_throw();
  const auto subscription = node.subscribe(name + "/odom").or_throw();
  publisher.wait_for_subscribers(1, kWait).or_throw();
  expect(static_cast<bool>(publisher.publish("x 1.0")), "it is published");
  expect(subscription.receive(kWait).or_throw().text() == "x 1.0", "a message comes");
  const auto add = node.answer("add").or_throw();
  std::thread answering([&] { add.receive(kWait).or_throw().reply("3").or_throw(); });
  const auto reply = node.request(name + "/add", "1 2", kWait);
  answering.join();
  expect(reply && reply.text() == "3" && reply.ran() == Ran::yes, "a request is answered");
  expect(node.nodes(name).or_throw().size() == 1, "the node is listed");
}
