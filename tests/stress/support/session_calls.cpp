#include <gtest/gtest.h>

#include <array>
#include <chrono>
#include <optional>
#include <string>
#include <thread>
#include <utility>

#include "gimnet/gimi.hpp"
#include "gimnet/gimi/executor.hpp"
#include "tests/stress/support/api_caller.hpp"

// A session of a C++ program: the classes of gimnet/gimi.hpp, and an Executor. Everything in it
// belongs to one thread but a copy of a subscription, with which another one waits.

namespace gimnet::stress {
namespace {

constexpr std::int32_t kRunMs = 60;

/// An Executor over all that it can wait for, until it is stopped or its node was ended.
void run_executor(ApiCaller& c, Node& node) {
  const std::string own = node.state().name + "/";
  auto set = WaitSet::make();
  if (!set) return;
  Executor executor(*set);
  const auto publisher = node.advertise("p", {.retain = c.one_in(2)});
  const auto answers = node.answer("q");
  const auto accepted = node.accept("s");
  const auto subscription = node.subscribe(own + "p", {.newest_only = c.one_in(2)});
  const auto watch = node.watch();
  const auto connection = node.watch_connection();
  if (!publisher || !answers || !accepted || !subscription || !watch || !connection) return;
  static_cast<void>(executor.on(*publisher, [](std::size_t) {}));
  static_cast<void>(executor.on(
      *answers, [](Request request) { static_cast<void>(request.reply("yes", kNoWait)); }));
  static_cast<void>(
      executor.on(*accepted, [](const Message& message) { static_cast<void>(message.text()); }));
  static_cast<void>(executor.on(*watch, [](const WatchEvent&) {}));
  static_cast<void>(executor.on(*connection, [](const ConnectionEvent&) {}));
  const auto read = executor.on(*subscription, [](const Message& message) {
    EXPECT_TRUE(message.text().empty() || message.text() == "data");
  });
  executor.every(Timeout{2}, [&] {
    publisher->publish("data", kNoWait);
    static_cast<void>(node.send(own + "s", "data", {}, Timeout{20}));
    const auto pending = node.request_later(own + "q", "?", Timeout{50});
    if (pending) static_cast<void>(executor.on(*pending, [](const Reply&) {}));
    if (c.one_in(10) && read) executor.off(*read);
    if (c.one_in(30)) node.close();
  });
  std::thread other([copy = *subscription, seconds = Timeout{kRunMs / 2}, &executor] {
    static_cast<void>(copy.receive(seconds));
    executor.stop();
  });
  static_cast<void>(executor.run());
  other.join();
}

void session(ApiCaller& c) {
  NodeOptions options;
  options.name = c.one_of({"session", "viewer"});
  options.number_if_taken = true;
  options.keep_token = false;
  options.timeout = Timeout{500};
  options.hub = c.shared.hubs[c.below(c.shared.hubs.size())];
  // Each of its calls waits for a second at most, but that is not what is judged here.
  c.timed(20'000, [&]() -> gimi_status {
    auto node = Node::join(options);
    if (!node) return static_cast<gimi_status>(node.failure().status);
    Node moved(std::move(*node));
    run_executor(c, moved);
    return GIMI_OK;
  });
}

}  // namespace

std::span<const ApiCall> session_calls() {
  static constexpr std::array kCalls{ApiCall{"session of an Executor", session, 1, false}};
  return kCalls;
}

}  // namespace gimnet::stress
