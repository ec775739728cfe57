#include "hub/control/conductor_loop.hpp"

#include <gtest/gtest.h>
#include <netinet/in.h>
#include <sys/socket.h>
#include <unistd.h>

#include <csignal>
#include <thread>

#include "base/log.hpp"
#include "hub/shard/control_frame.hpp"
#include "proto/control/ns.hpp"
#include "tests/hub/control/support/peer.hpp"
#include "tests/hub/control/support/test_conductor.hpp"

namespace gimnet::hub {
namespace {

int dial(std::uint16_t port) {
  const int client = ::socket(AF_INET, SOCK_STREAM | SOCK_CLOEXEC, 0);
  sockaddr_in address{};
  address.sin_family = AF_INET;
  address.sin_port = htons(port);
  address.sin_addr.s_addr = htonl(INADDR_LOOPBACK);
  EXPECT_EQ(::connect(client, reinterpret_cast<const sockaddr*>(&address), sizeof address), 0);
  return client;
}

TEST(ConductorLoop, ANameThatWasGivenBackIsFreeHoweverMuchWasToldBefore) {
  set_log_level(LogLevel::off);
  TestConductor hub;
  const TestConductor::Node former = hub.join("robot");
  ControlInbox inbox(2);
  // Of a session that is not there any more.
  for (int i = 0; i < 50'000; ++i)
    inbox.push({ShardIndex{0}, ControlFrameEvent{SessionRef{ConnectionSlot{500}, 9}, 1, {}, {}}});
  inbox.push({former.shard, DetachedEvent{former.session, former.attachment, former.id, true,
                                          proto::GoodbyeCode::done, ""}});
  std::vector<std::unique_ptr<Listener>> listeners;
  listeners.push_back(std::move(*Listener::open(*parse_listen_url("tcp://127.0.0.1:0"))));
  const int client = dial(static_cast<std::uint16_t>(listeners[0]->url().port));
  proto::Hello hello;
  hello.name = "robot";
  const std::vector<std::byte> bytes = opening_and(hello);
  ASSERT_EQ(::send(client, bytes.data(), bytes.size(), MSG_NOSIGNAL),
            static_cast<ssize_t>(bytes.size()));
  bool admitted = false;
  hub.shards.on_send = [&](const ShardCommand& command) {
    if (std::holds_alternative<AttachCommand>(command)) {
      admitted = true;
      ::raise(SIGTERM);
    }
    if (std::holds_alternative<DrainCommand>(command)) {
      for (const ShardIndex shard : {ShardIndex{0}, ShardIndex{1}})
        inbox.push({shard, DrainedEvent{}});
    }
  };
  LinkDialler dialler;
  ConductorLoop loop({hub.conductor, inbox, hub.limits, hub.refusals, dialler},
                     std::move(listeners));
  // Admitted, it is told nothing here: its shard would say WELCOME.
  std::thread refused([client] {
    std::byte answer[512];
    if (::recv(client, answer, sizeof answer, 0) > 0) ::kill(::getpid(), SIGTERM);
    ::shutdown(client, SHUT_RDWR);
  });
  loop.run();
  ::shutdown(client, SHUT_RDWR);
  refused.join();
  ::close(client);
  set_log_level(LogLevel::info);
  EXPECT_TRUE(admitted);
}

TEST(ConductorLoop, ARequestWaitsForOneAnswerToEachOtherNode) {
  constexpr std::size_t kBusy = 8;
  constexpr std::uint16_t kRequests = 60;
  set_log_level(LogLevel::off);
  TestConductor hub;
  std::vector<TestConductor::Node> busy;
  for (std::size_t i = 0; i < kBusy; ++i) busy.push_back(hub.join("busy-" + std::to_string(i)));
  const TestConductor::Node other = hub.join("other");
  ControlInbox inbox(2);
  const auto ask = [&inbox](const TestConductor::Node& node, const proto::Payload& request) {
    inbox.push({ShardIndex{0},
                ControlFrameEvent{node.session, node.attachment, node.id,
                                  control_frame(proto::Kind::ns, NodeId{}, HubId{7}, request)}});
  };
  for (const TestConductor::Node& node : busy) {
    for (std::uint16_t i = 1; i <= kRequests; ++i) ask(node, proto::encode(proto::ns::List{}, i));
  }
  ask(other, proto::encode(proto::ns::Resolve{"busy-0"}, 1));
  std::size_t answers = 0;
  std::size_t before = 0;
  hub.shards.on_send = [&](const ShardCommand& command) {
    if (const auto* answer = std::get_if<SendControlCommand>(&command)) {
      if (NodeId{proto::load_header(answer->frame.data()).dst} == other.id) before = answers;
      if (++answers == kBusy * kRequests + 1) ::raise(SIGTERM);
    }
    if (std::holds_alternative<DrainCommand>(command)) {
      for (const ShardIndex shard : {ShardIndex{0}, ShardIndex{1}})
        inbox.push({shard, DrainedEvent{}});
    }
  };
  LinkDialler dialler;
  ConductorLoop loop({hub.conductor, inbox, hub.limits, hub.refusals, dialler}, {});
  loop.run();
  set_log_level(LogLevel::info);
  EXPECT_EQ(answers, kBusy * kRequests + 1);
  EXPECT_EQ(before, kBusy) << "answers to others that came first";
}

}  // namespace
}  // namespace gimnet::hub
