// A loop of the program's own, with poll(), as Qt and GLib have one: shows where the robot of
// executor.cpp is, and asks it to drive at each speed that standard input says.

#include <poll.h>

#include <array>
#include <iostream>
#include <string>
#include <vector>

#include "gimnet/gimi.hpp"

namespace {

using Requests = std::vector<gimnet::PendingReply>;

/// Asks for each line that is there. False: it was the last.
bool ask(const gimnet::Node& node, const gimnet::WaitSet& set, Requests& asked) {
  do {  // what std::cin has read already, poll() does not tell
    std::string speed;
    if (!std::getline(std::cin, speed)) return false;
    const auto pending = node.request_later("robot/speed", speed);
    if (pending) {
      set.add(*pending, 0).or_throw();
      asked.push_back(*pending);
    } else {
      std::cerr << pending.failure().sentence << '\n';
    }
  } while (std::cin.rdbuf()->in_avail() > 0);
  return true;
}

/// Shows the replies that came, and forgets their requests.
void show_replies(Requests& asked) {
  std::erase_if(asked, [](const gimnet::PendingReply& pending) {
    const auto reply = pending.wait(gimnet::kNoWait);
    if (!reply) return false;
    std::cout << (*reply ? std::string(reply->text()) : reply->failure().sentence) << std::endl;
    return true;
  });
}

}  // namespace

int main() try {
  std::ios::sync_with_stdio(false);
  const gimnet::Node node;
  const auto pose = node.subscribe("robot/pose").or_throw();
  Requests asked;
  const gimnet::WaitSet set;
  set.add(pose, 0).or_throw();
  std::array<pollfd, 2> polled{{{set.descriptor().or_throw(), POLLIN, 0}, {0, POLLIN, 0}}};
  while (::poll(polled.data(), polled.size(), -1) > 0) {
    if (polled[1].revents != 0 && !ask(node, set, asked)) return 0;
    // The set stays readable while a member has something, so one message in each turn is enough.
    if (const auto message = pose.try_receive()) std::cout << message->text() << std::endl;
    show_replies(asked);
  }
  return 1;
} catch (const gimnet::GimnetError& error) {
  std::cerr << "poll_loop: " << error.what() << '\n';
  return 1;
}
