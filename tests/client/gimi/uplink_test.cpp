#include "client/gimi/uplink.hpp"

#include <gtest/gtest.h>
#include <sys/wait.h>
#include <unistd.h>

#include <atomic>
#include <cstdio>
#include <optional>
#include <string>
#include <thread>

#include "gimnet/gimi.hpp"
#include "tests/client/gimi/support/hub_process.hpp"

namespace gimnet::gimi {
namespace {

using test::HubProcess;

constexpr Timeout kWait{5000};

/// In a child: which of its calls does not answer `forked`; "": none.
std::string wrong_call(const Node& node, const Publisher& publisher,
                       const Subscription& subscription, const Sender& sender, const Queue& queue,
                       const Watch& watch) {
  const auto is_forked = [](const auto& outcome) { return outcome.is(Status::forked); };
  if (!is_forked(subscription.receive())) return "Subscription::receive";
  if (!is_forked(subscription.wait_until_exists())) return "wait_until_exists";
  if (!is_forked(subscription.standing())) return "Subscription::standing";
  if (!is_forked(subscription.queue().receive())) return "Subscription::queue";
  if (!is_forked(queue.receive())) return "Queue::receive";
  if (!is_forked(watch.receive())) return "Watch::receive";
  if (!is_forked(sender.send("x"))) return "Sender::send";
  if (!is_forked(sender.settle())) return "Sender::settle";
  if (!is_forked(publisher.publish("x", kForever))) return "publish";
  if (!is_forked(publisher.wait_for_subscribers(9))) return "wait_for_subscribers";
  if (!is_forked(publisher.standing())) return "Publisher::standing";
  if (!is_forked(publisher.retained())) return "Publisher::retained";
  if (!is_forked(node.receive())) return "Node::receive";
  if (!is_forked(node.receive({1, 2}, kForever))) return "Node::receive(key)";
  if (!is_forked(node.queue({8, 8}).receive())) return "Node::queue";
  if (!is_forked(node.ping(node.peer(), kWait))) return "ping";
  if (!is_forked(node.trace(node.peer(), kWait))) return "trace";
  if (!is_forked(node.advertise("other"))) return "advertise";
  if (!is_forked(node.accept("another"))) return "accept";
  if (!is_forked(node.subscribe("robot/other"))) return "subscribe";
  if (!is_forked(node.watch("**"))) return "watch";
  if (!is_forked(node.sender(Peer{1}))) return "sender";
  if (!is_forked(node.sender("robot/odom"))) return "sender to a service";
  if (!is_forked(node.send(Peer{1}, "x"))) return "send";
  if (!is_forked(node.find("robot"))) return "find";
  if (!is_forked(node.find("7.17"))) return "find by an id";
  if (!is_forked(node.nodes())) return "nodes";
  if (!is_forked(node.take_name("x"))) return "take_name";
  if (!is_forked(node.flush())) return "flush";
  if (!is_forked(node.drain())) return "drain";
  if (!is_forked(node.send("robot/odom", "x"))) return "send to a service";
  if (!is_forked(node.services())) return "services";
  if (!is_forked(node.name_of(Peer{1}))) return "name_of";
  if (!is_forked(node.give_name_back())) return "give_name_back";
  if (!is_forked(node.hub())) return "hub";
  if (!is_forked(node.hub_counters())) return "hub_counters";
  if (!is_forked(node.hub_connections())) return "hub_connections";
  if (!is_forked(node.hubs())) return "hubs";
  if (!is_forked(node.hub_links())) return "hub_links";
  if (!is_forked(node.add_link("unix:/a"))) return "add_link";
  if (!is_forked(node.remove_link("a"))) return "remove_link";
  if (!is_forked(node.set_link_cost("a", 1))) return "set_link_cost";
  if (!is_forked(node.kick(Peer{1}))) return "kick";
  if (!is_forked(node.reassign(Peer{1}, Peer{2}))) return "reassign";
  if (!is_forked(node.drain_hub())) return "drain_hub";
  if (!is_forked(node.reload_hub())) return "reload_hub";
  if (!is_forked(node.set_hub_log_level("debug"))) return "set_hub_log_level";
  if (subscription.try_receive() || queue.try_receive() || queue.take_newest() ||
      watch.try_receive())
    return "something that was received";
  if (queue.size() + publisher.subscribers() + node.dropped() + node.lost().all() != 0)
    return "a count";
  return "";
}

TEST(Home, AChildIsToldThatTheNodeIsItsParentsAndLeavesItAlone) {
  const HubProcess hub;
  std::optional<Node> node(Node("robot", hub.url()));
  std::optional<Publisher> publisher(node->advertise("odom").or_throw());
  std::optional<Subscription> subscription(node->subscribe("robot/odom").or_throw());
  std::optional<Sender> sender(node->sender(node->peer()).or_throw());
  std::optional<Queue> queue(node->queue({1, 2}));
  std::optional<Watch> watch(node->watch("robot").or_throw());
  // Other threads of the parent use it: a lock may be held when the child begins.
  std::atomic<bool> over = false;
  std::thread busy([&] {
    while (!over) {
      static_cast<void>(publisher->publish("pose", kWait));
      static_cast<void>(subscription->try_receive());
    }
  });
  for (int i = 0; i < 20; ++i) {
    const pid_t child = ::fork();
    ASSERT_GE(child, 0);
    if (child == 0) {
      ::alarm(20);  // where it hangs
      const std::string wrong =
          wrong_call(*node, *publisher, *subscription, *sender, *queue, *watch);
      if (!wrong.empty()) std::fprintf(stderr, "in a child: %s\n", wrong.c_str());
      watch.reset();
      queue.reset();
      sender.reset();
      subscription.reset();
      publisher.reset();
      node.reset();
      ::_exit(wrong.empty() ? 0 : 1);
    }
    int status = 0;
    ASSERT_EQ(::waitpid(child, &status, 0), child);
    ASSERT_EQ(status, 0);
  }
  over = true;
  busy.join();
  publisher->publish("the parent goes on", kWait).or_throw();
  std::string last;
  while (last != "the parent goes on") last = subscription->receive(kWait).or_throw().text();
}

}  // namespace
}  // namespace gimnet::gimi
