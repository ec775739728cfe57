#include <gtest/gtest.h>

#include <algorithm>
#include <atomic>
#include <csignal>
#include <cstdint>
#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <map>
#include <string>
#include <thread>
#include <vector>

#include "gimnet/gimi.hpp"
#include "tests/client/gimi/support/hub_process.hpp"
#include "tests/client/nif/support/runtime_folder.hpp"

namespace gimnet {
namespace {

using test::eventually;
using test::HubProcess;
using test::kPatience;

constexpr Timeout kWait = std::chrono::duration_cast<Timeout>(kPatience);

class NodeTest : public testing::Test {
 protected:
  [[nodiscard]] Node join(const std::string& name = {}) { return Node(name, hub_.url()); }
  HubProcess hub_{{"--shards", "2"}};
};

TEST_F(NodeTest, JoinsWithAName) {
  const Node node = join("robot");
  const NodeState state = node.state();
  EXPECT_EQ(state.name, "robot");
  EXPECT_EQ(state.hub_id, 7u);
  EXPECT_TRUE(state.connected);
  EXPECT_EQ(state.peer, node.peer());
  EXPECT_TRUE(node.peer());
}

TEST_F(NodeTest, TellsWhatBecomesOfItsConnectionIfAskedTo) {
  ASSERT_EQ(::setenv("GIMNET_LOG", "info", 1), 0);
  testing::internal::CaptureStderr();
  const Node node = Node::join({.name = "robot", .hub = hub_.url(), .reconnect = false}).or_throw();
  const ConnectionWatch connection = node.watch_connection().or_throw();
  EXPECT_EQ(connection.receive(kWait)->change, ConnectionChange::connected);
  hub_.kill();
  EXPECT_FALSE(node.receive(kWait));
  const ConnectionEvent ended = connection.receive(kWait).or_throw();
  EXPECT_EQ(ended.change, ConnectionChange::ended);
  EXPECT_TRUE(connection.receive(kWait).is(Status::not_connected));
  ASSERT_EQ(::unsetenv("GIMNET_LOG"), 0);
  const std::string told = testing::internal::GetCapturedStderr();
  EXPECT_NE(told.find("gimnet: robot: connected to the hub "), std::string::npos) << told;
  EXPECT_NE(told.find("gimnet: robot: no connection will come any more: "), std::string::npos)
      << told;
  EXPECT_NE(told.find("gimnet: robot: " + ended.why), std::string::npos) << told;
}

// Signals belong to the program, which may wait for them with sigwait() in a thread of its own.
TEST_F(NodeTest, HasOneLibraryThreadWhichTakesNoSignals) {
  const auto tasks = [] {
    std::map<std::string, std::uint64_t> blocked;
    for (const auto& task : std::filesystem::directory_iterator("/proc/self/task")) {
      std::ifstream status(task.path() / "status");
      for (std::string line; std::getline(status, line);) {
        if (line.starts_with("SigBlk:"))
          blocked[task.path().filename()] = std::stoull(line.substr(7), nullptr, 16);
      }
    }
    return blocked;
  };
  const auto before = tasks();
  const Node node = join("robot");
  const Node viewer = join();
  viewer.send(node.peer(), "x").or_throw();
  // All but SIGKILL, SIGSTOP, and the two that belong to the C library.
  constexpr std::uint64_t kAll =
      ~((1ull << (SIGKILL - 1)) | (1ull << (SIGSTOP - 1)) | (3ull << 31));
  std::size_t threads = 0;
  for (const auto& [task, blocked] : tasks()) {
    if (before.contains(task)) continue;
    ++threads;
    EXPECT_EQ(blocked & kAll, kAll) << "thread " << task;
  }
  EXPECT_EQ(threads, 2u) << "one for each node";
}

TEST_F(NodeTest, KeepsItsTokenWhileItLivesUnlessToldNotTo) {
  const nif::test::RuntimeFolder runtime;
  NodeOptions options;
  options.name = "robot";
  options.hub = hub_.url();
  for (const bool keep : {true, false}) {
    options.keep_token = keep;
    const auto node = Node::join(options);
    ASSERT_TRUE(node);
    const bool kept =
        std::filesystem::exists(runtime.tokens()) && !std::filesystem::is_empty(runtime.tokens());
    EXPECT_EQ(kept, keep);
  }
  EXPECT_TRUE(std::filesystem::is_empty(runtime.tokens())) << "gone with its node";
}

TEST_F(NodeTest, SaysWhyItCannotJoin) {
  const Node holder = join("robot");
  EXPECT_THROW(static_cast<void>(join("robot")), GimnetError);
  NodeOptions options;
  options.hub = hub_.url();
  options.name = "no spaces";
  EXPECT_TRUE(Node::join(options).is(Status::bad_name));
  options.hub = "tcp://127.0.0.1:1";
  options.name = "";
  EXPECT_TRUE(Node::join(options).is(Status::no_hub));
  options.hub = "pigeon://roof";
  EXPECT_TRUE(Node::join(options).is(Status::bad_argument));
}

TEST_F(NodeTest, JoinsUnderTheNextNumberIfItsNameIsTaken) {
  const NodeOptions options{.name = "robot", .hub = hub_.url(), .number_if_taken = true};
  std::vector<Node> nodes;
  for (const char* name : {"robot", "robot-2", "robot-3"}) {
    nodes.push_back(Node::join(options).or_throw());
    EXPECT_EQ(nodes.back().state().name, name);
  }
  nodes.erase(nodes.begin() + 1);
  EXPECT_EQ(Node::join(options)->state().name, "robot-2") << "it is free again";
}

TEST_F(NodeTest, SendsToANodeThatWasFound) {
  const Node sender = join();
  const Node receiver = join("B");
  sender.send(sender.find("B").or_throw(), "by name").or_throw();
  sender.send(receiver.peer(), "by id").or_throw();
  sender.send(sender.find(receiver.peer().text()).or_throw(), "by id as text").or_throw();
  for (const char* text : {"by name", "by id", "by id as text"}) {
    const auto message = receiver.receive(MessageKey{}, kWait);
    ASSERT_TRUE(message);
    EXPECT_EQ(message->text(), text);
    EXPECT_EQ(message->from(), sender.peer());
  }
  const auto refused = sender.send("B", "a text names a service");
  ASSERT_TRUE(refused.is(Status::bad_name));
  EXPECT_NE(refused.failure().sentence.find("find()"), std::string::npos);
  EXPECT_TRUE(sender.send("nobody/drive", "x").is(Status::not_found));
}

TEST_F(NodeTest, RefusesASecondSenderWithOtherOptions) {
  const Node sender = join();
  const Node receiver = join("B");
  const Queue drive = receiver.accept("drive").or_throw();
  const SendOptions synchronized{.window = 2};
  sender.send(receiver.peer(), "1", synchronized).or_throw();
  sender.send(receiver.peer(), "2", synchronized).or_throw();
  const auto refused = sender.send(receiver.peer(), "3");
  ASSERT_TRUE(refused.is(Status::bad_argument));
  EXPECT_NE(refused.failure().sentence.find("another key"), std::string::npos);
  EXPECT_TRUE(sender.sender(receiver.peer(), {.key = {1, 0}})) << "that is another stream";
  sender.send("B/drive", "3", synchronized).or_throw();
  const auto other = sender.sender("B/drive");
  ASSERT_TRUE(other.is(Status::bad_argument));
  EXPECT_NE(other.failure().sentence.find("B/drive"), std::string::npos);
  for (const char* text : {"1", "2"}) EXPECT_EQ(receiver.receive(kWait).or_throw().text(), text);
  EXPECT_EQ(drive.receive(kWait).or_throw().text(), "3") << "sent to the service";
}

TEST_F(NodeTest, StampsMessages) {
  const Node sender = join();
  const Node receiver = join();
  SendOptions options;
  options.timestamp = true;
  options.lane = Lane::real_time;
  sender.send(receiver.peer(), "x", options).or_throw();
  const auto message = receiver.receive(kWait);
  ASSERT_TRUE(message);
  ASSERT_TRUE(message->sent_ns());
  EXPECT_LE(*message->sent_ns(), message->arrival_ns());
  EXPECT_EQ(message->lane(), Lane::real_time);
}

TEST_F(NodeTest, AcknowledgedMessagesArriveInOrder) {
  const Node sender = join();
  const Node receiver = join("B");
  const Queue queue = receiver.queue({}, {100000, AtFullQueue::stop_reading});
  SendOptions options;
  options.window = 5;
  const Sender stream = sender.sender(receiver.peer(), options).or_throw();
  for (int i = 0; i < 5000; ++i)
    stream.send(std::to_string(i), kForever, i % 7 != 0 ? More::yes : More::no).or_throw();
  stream.settle(kWait).or_throw();
  EXPECT_EQ(stream.counts().acknowledged, 5000u);
  for (int i = 0; i < 5000; ++i) ASSERT_EQ(queue.receive(kNoWait)->text(), std::to_string(i));
}

TEST_F(NodeTest, SynchronizedStreamsTellWhenTheReceiverGoes) {
  const Node sender = join();
  Node receiver = join();
  SendOptions options;
  options.window = 2;
  const Sender stream = sender.sender(receiver.peer(), options).or_throw();
  stream.send("x").or_throw();
  stream.settle(kWait).or_throw();
  receiver.close();
  stream.send("y").or_throw();
  EXPECT_TRUE(stream.settle(kWait).is(Status::not_delivered));
}

TEST_F(NodeTest, AFullQueueOverwritesTheOldest) {
  const Node sender = join();
  const Node receiver = join();
  const Queue queue = receiver.queue({1, 0}, {10, AtFullQueue::overwrite_oldest});
  SendOptions options;
  options.key = {1, 0};
  options.window = 1;
  const Sender stream = sender.sender(receiver.peer(), options).or_throw();
  for (int i = 1; i <= 100; ++i) stream.send(std::to_string(i)).or_throw();
  stream.settle(kWait).or_throw();
  EXPECT_EQ(queue.overwritten(), 90u);
  EXPECT_EQ(queue.received(), 100u);
  for (int i = 91; i <= 100; ++i) EXPECT_EQ(queue.try_receive()->text(), std::to_string(i));
}

TEST_F(NodeTest, AQueueThatStopsReadingLosesNothing) {
  const Node sender = join();
  const Node receiver = join();
  const Queue queue = receiver.queue({}, {4, AtFullQueue::stop_reading});
  const Sender stream = sender.sender(receiver.peer()).or_throw();
  for (int i = 0; i < 1000; ++i) stream.send(std::to_string(i)).or_throw();
  for (int i = 0; i < 1000; ++i) ASSERT_EQ(queue.receive(kWait)->text(), std::to_string(i));
  EXPECT_EQ(queue.overwritten(), 0u);
}

TEST_F(NodeTest, AnIdThatMeansAllNodesIsNoAddress) {
  const Node node = join();
  const Peer all{node.peer().id | 0xFFFFF};
  const auto pinged = node.ping(all);
  EXPECT_TRUE(pinged.is(Status::bad_argument));
  EXPECT_EQ(pinged.failure().sentence, all.text() + " cannot be pinged: this id means all nodes");
  EXPECT_TRUE(node.sender(all).is(Status::bad_argument));
}

TEST_F(NodeTest, PingsAnyNode) {
  const Node first = join();
  Node second = join();
  const auto round_trip = first.ping(second.peer(), kWait, Lane::real_time, "echo");
  ASSERT_TRUE(round_trip);
  EXPECT_GT(*round_trip, 0);
  const auto traced = first.trace(second.peer(), kWait);
  ASSERT_TRUE(traced);
  ASSERT_EQ(traced->way_back.size(), 1u);
  EXPECT_EQ(traced->way_back[0].hub_id, first.hub().or_throw().hub_id);
  EXPECT_LE(traced->way_back[0].arrival_ns, traced->way_back[0].departure_ns);
  const Peer gone = second.peer();
  second.close();
  EXPECT_TRUE(first.ping(gone, kWait).is(Status::not_delivered));
}

TEST_F(NodeTest, ListsNodesServicesAndCounters) {
  const Node robot = join("robot");
  const Node watcher = join();
  const auto odometry =
      robot.advertise("odom", {Delivery::latest, {4, 2}, Lane::normal, true, "pose"}).or_throw();
  AcceptOptions drive;
  drive.key = {5, 0};
  const Queue commands = robot.accept("drive", drive).or_throw();
  const auto services = watcher.services("robot/*").or_throw();
  ASSERT_EQ(services.size(), 2u);
  EXPECT_EQ(services[0].name, "robot/odom");
  EXPECT_EQ(services[0].key, (MessageKey{4, 2}));
  EXPECT_EQ(services[0].metadata, "pose");
  EXPECT_EQ(services[0].delivery, Delivery::latest);
  EXPECT_EQ(services[1].direction, Direction::accepts);
  EXPECT_EQ(watcher.nodes("robot").or_throw().at(0).services, 2u);
  EXPECT_EQ(watcher.nodes().or_throw().size(), 2u);
  EXPECT_EQ(watcher.find("robot").or_throw(), robot.peer());
  EXPECT_EQ(watcher.name_of(robot.peer()).or_throw(), "robot");
  EXPECT_TRUE(watcher.find("nobody").is(Status::not_found));
  EXPECT_EQ(watcher.hub().or_throw().shards, 2u);
  const auto counters = watcher.hub_counters().or_throw();
  EXPECT_EQ(std::ranges::count_if(
                counters, [](const auto& of) { return of.shard != ShardCounts::kConductor; }),
            2);
  EXPECT_EQ(watcher.hub_connections().or_throw().size(), 2u);
  watcher.sender("robot/drive").or_throw().send("go").or_throw();
  EXPECT_EQ(commands.receive(kWait)->text(), "go");
  EXPECT_TRUE(watcher.sender("robot/odom").is(Status::not_found));
}

TEST_F(NodeTest, ManyThreadsUseOneNode) {
  constexpr int kThreads = 4;
  constexpr int kMessages = 500;
  const Node sender = join();
  const Node receiver = join();
  std::vector<std::thread> threads;
  std::atomic<int> received{0};
  for (int thread = 0; thread < kThreads; ++thread) {
    const MessageKey key{static_cast<std::uint32_t>(thread), 0};
    const Queue queue = receiver.queue(key, {kMessages, AtFullQueue::stop_reading});
    threads.emplace_back([&received, queue] {
      for (std::uint32_t i = 1; i <= kMessages; ++i)
        received += queue.receive(kWait)->sequence() == i ? 1 : 0;
    });
    threads.emplace_back([&sender, &receiver, key] {
      SendOptions options;
      options.key = key;
      options.window = 8;
      const Sender stream = sender.sender(receiver.peer(), options).or_throw();
      for (int i = 0; i < kMessages; ++i) stream.send("x").or_throw();
      stream.settle(kWait).or_throw();
    });
  }
  for (std::thread& thread : threads) thread.join();
  EXPECT_EQ(received, kThreads * kMessages);
}

TEST_F(NodeTest, ClosingAnswersEverybody) {
  Node node = join("robot");
  const Publisher publisher = node.advertise("odom").or_throw();
  const Subscription subscription = node.subscribe("other/odom").or_throw();
  const Sender stream = node.sender(node.peer()).or_throw();
  std::thread waiter([&] { EXPECT_TRUE(subscription.receive().is(Status::closed)); });
  std::thread subscribers(
      [&] { EXPECT_TRUE(publisher.wait_for_subscribers(1).is(Status::closed)); });
  node.close();
  waiter.join();
  subscribers.join();
  EXPECT_FALSE(publisher.publish("x"));
  EXPECT_FALSE(stream.send("x"));
  EXPECT_FALSE(node.subscribe("a/b"));
  EXPECT_FALSE(node.ping(Peer{1}));
  EXPECT_TRUE(node.state().connected) << "as it was when it was closed";
  node.close();
}

TEST_F(NodeTest, WhoSendsTooMuchToAServiceIsTold) {
  NodeOptions options;
  options.name = "robot";
  options.hub = hub_.url();
  options.message_bytes_max = 10;
  const Node robot = Node::join(options).or_throw();
  const Queue queue = robot.accept("drive").or_throw();
  const Node viewer = join();
  SendOptions synchronized;
  synchronized.window = 2;
  const Sender drive = viewer.sender("robot/drive", synchronized).or_throw();
  drive.send("ten bytes.", kWait).or_throw();
  drive.send("and eleven.", kWait).or_throw();
  EXPECT_TRUE(drive.settle(kWait).is(Status::not_delivered));
  EXPECT_EQ(drive.counts().acknowledged, 1u);
  EXPECT_EQ(drive.counts().loss_reason, LossReason::refused);
  EXPECT_NE(drive.counts().loss.find("at most 10 bytes"), std::string::npos) << drive.counts().loss;
  EXPECT_EQ(queue.receive(kWait)->text(), "ten bytes.");
}

TEST_F(NodeTest, WhatWasMovedFromMayBeClosed) {
  Node node = join("robot");
  Node other = std::move(node);
  EXPECT_EQ(other.state().name, "robot");
  node.close();  // NOLINT(bugprone-use-after-move): that is what is tried
  EXPECT_TRUE(other.flush());
  other.close();
  EXPECT_TRUE(other.flush().is(Status::closed));
}

TEST_F(NodeTest, TellsWhenTheHubIsGone) {
  const Node node = join();
  SendOptions options;
  options.window = 1;
  const Sender stream = node.sender(Peer{(7u << 20) | 500}, options).or_throw();
  hub_.kill();
  EXPECT_TRUE(eventually([&] { return !node.state().connected; }));
  EXPECT_FALSE(node.state().trouble.empty());
  EXPECT_TRUE(stream.send("x", Timeout{1}).is(Status::not_connected));
}

TEST_F(NodeTest, TellsTheEventsOfItsConnectionWithTheirCauses) {
  const Node node = join("robot");
  const ConnectionWatch connection = node.watch_connection().or_throw();
  const WaitSet set;
  set.add(connection, 1).or_throw();
  ASSERT_TRUE(set.wait(kWait));
  EXPECT_EQ(connection.receive(kNoWait)->change, ConnectionChange::connected);
  EXPECT_TRUE(set.wait(kNoWait).is(Status::timeout));
  hub_.kill();
  ASSERT_TRUE(set.wait(kWait));
  const ConnectionEvent lost = connection.receive(kNoWait).or_throw();
  EXPECT_EQ(lost.change, ConnectionChange::lost);
  EXPECT_EQ(lost.why, "lost the connection to the hub: " + node.state().trouble);
  const HubProcess again({"--shards", "2", "--listen", hub_.url()});
  const ConnectionEvent back = connection.receive(kWait).or_throw();
  EXPECT_EQ(back.change, ConnectionChange::connected_anew) << "another hub keeps no session";
  EXPECT_TRUE(back.is_connected());
}

}  // namespace
}  // namespace gimnet
