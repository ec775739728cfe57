#include "gimnet/gimi/executor.hpp"

#include <gtest/gtest.h>
#include <poll.h>

#include <cstddef>
#include <optional>
#include <stdexcept>
#include <string>
#include <thread>
#include <vector>

#include "gimnet/gimi.hpp"
#include "gimnet/gimi/executor.hpp"
#include "tests/client/gimi/support/hub_process.hpp"

// Wait sets and callbacks, as programs use them.

namespace gimnet {
namespace {

constexpr Timeout kWait = std::chrono::duration_cast<Timeout>(test::kPatience);
using Users = std::vector<std::uint64_t>;

class ExecutorTest : public testing::Test {
 protected:
  /// Publishes to a subscription of the viewer once it is there.
  struct Pair {
    Publisher publisher;
    Subscription subscription;
  };
  Pair pair(const std::string& name) {
    auto subscription = viewer_.subscribe("robot/" + name).or_throw();
    auto publisher = robot_.advertise(name).or_throw();
    publisher.wait_for_subscribers(1, kWait).or_throw();
    return {publisher, subscription};
  }
  test::HubProcess hub_;
  Node robot_{"robot", hub_.url()};
  Node viewer_{"viewer", hub_.url()};
  WaitSet set_;
  Executor executor_;
};

TEST_F(ExecutorTest, AWaitSetTellsOfEachKindOfMember) {
  auto [pose, seen] = pair("pose");
  const Queue drive = robot_.accept("drive").or_throw();
  const Answers answers = robot_.answer("add").or_throw();
  const Watch watch = viewer_.watch("nobody/*").or_throw();
  set_.add(seen, 1).or_throw();
  set_.add(drive, 2).or_throw();
  set_.add(answers, 3).or_throw();
  pose.publish("x").or_throw();
  EXPECT_EQ(set_.wait(kWait).or_throw(), Users{1});
  EXPECT_EQ(seen.receive(kNoWait)->text(), "x");
  EXPECT_TRUE(set_.wait(kNoWait).is(Status::timeout));

  viewer_.send("robot/drive", "left").or_throw();
  EXPECT_EQ(set_.wait(kWait).or_throw(), Users{2});
  EXPECT_TRUE(drive.try_receive());

  const PendingReply pending = viewer_.request_later("robot/add", "1 2", kWait).or_throw();
  EXPECT_EQ(set_.wait(kWait).or_throw(), Users{3});
  set_.add(pending, 4).or_throw();
  answers.receive(kNoWait).or_throw().reply("3").or_throw();
  EXPECT_EQ(set_.wait(kWait).or_throw(), Users{4});
  EXPECT_EQ(pending.wait(kNoWait)->text(), "3");
  EXPECT_TRUE(set_.add(pending, 4).is(Status::closed)) << "it has given its end";

  set_.add(watch, 5).or_throw();  // its snapshot
  EXPECT_EQ(set_.wait(kWait).or_throw(), Users{5});
  set_.remove(watch).or_throw();
  set_.add(viewer_, 6).or_throw();
  robot_.send(robot_.find("viewer").or_throw(), "hello").or_throw();
  EXPECT_EQ(set_.wait(kWait).or_throw(), Users{6});
  EXPECT_EQ(viewer_.receive(kNoWait)->text(), "hello");
  EXPECT_TRUE(set_.wait(kNoWait).is(Status::timeout));
}

TEST_F(ExecutorTest, APublisherIsToldWhenItsSubscribersChange) {
  const Publisher eye = robot_.advertise("eye").or_throw();
  set_.add(eye, 1).or_throw();
  EXPECT_EQ(set_.wait(kWait).or_throw(), Users{1}) << "at first";
  EXPECT_EQ(eye.subscribers_changed(kNoWait).or_throw(), 0u);
  EXPECT_TRUE(set_.wait(kNoWait).is(Status::timeout));
  EXPECT_TRUE(eye.subscribers_changed(Timeout{1}).is(Status::timeout));
  {
    const auto seen = viewer_.subscribe("robot/eye").or_throw();
    EXPECT_EQ(set_.wait(kWait).or_throw(), Users{1});
    EXPECT_EQ(set_.wait(kWait).or_throw(), Users{1}) << "until it was asked";
    EXPECT_EQ(eye.subscribers(), 1u);
    EXPECT_EQ(eye.subscribers_changed(kNoWait).or_throw(), 1u);
    EXPECT_TRUE(set_.wait(kNoWait).is(Status::timeout));
  }
  EXPECT_EQ(eye.subscribers_changed(kWait).or_throw(), 0u);
  set_.remove(eye).or_throw();

  std::vector<std::size_t> told;
  std::optional<Subscription> seen;
  executor_
      .on(eye,
          [&](std::size_t count) {
            told.push_back(count);
            if (count == 1) robot_.close();
          })
      .or_throw();
  seen = viewer_.subscribe("robot/eye").or_throw();
  executor_.run().or_throw();  // ends with what it waits for
  EXPECT_EQ(told, std::vector<std::size_t>{1});
  EXPECT_TRUE(eye.subscribers_changed(kNoWait).is(Status::closed));
}

TEST_F(ExecutorTest, AMemberIsInOneSetUntilItIsRemovedOrEnds) {
  auto seen = viewer_.subscribe("robot/a").or_throw();
  const WaitSet other;
  set_.add(seen, 1).or_throw();
  EXPECT_TRUE(other.add(seen, 1).is(Status::taken));
  EXPECT_TRUE(other.remove(seen).is(Status::not_found));
  set_.remove(seen).or_throw();
  EXPECT_TRUE(set_.remove(seen).is(Status::not_found));
  other.add(seen, 1).or_throw();
  viewer_.close();  // it has its end to tell
  EXPECT_EQ(other.wait(kWait).or_throw(), Users{1});
  EXPECT_TRUE(seen.receive(kNoWait).is(Status::closed));
  EXPECT_EQ(other.wait(kWait).or_throw(), Users{1});
  seen = robot_.subscribe("robot/b").or_throw();  // ends the first one
  EXPECT_TRUE(other.wait(kNoWait).is(Status::timeout));
}

TEST_F(ExecutorTest, ARequestThatNobodyAnswersIsTold) {
  const Answers answers = robot_.answer("add").or_throw();
  const PendingReply pending = viewer_.request_later("robot/add", "1", Timeout{20}).or_throw();
  set_.add(pending, 1).or_throw();
  EXPECT_EQ(set_.wait(kWait).or_throw(), Users{1});
  EXPECT_TRUE(pending.wait(kNoWait)->is(Status::timeout));
}

TEST_F(ExecutorTest, SilenceIsTold) {
  const auto seen = viewer_.subscribe("robot/a", {.silence = Timeout{20}}).or_throw();
  set_.add(seen, 1).or_throw();
  for (int i = 0; i < 2; ++i) {
    EXPECT_EQ(set_.wait(kWait).or_throw(), Users{1});
    EXPECT_TRUE(seen.receive(kNoWait).is(Status::silence));
  }
}

TEST_F(ExecutorTest, AForeignLoopWaitsByADescriptor) {
  auto [pose, seen] = pair("pose");
  set_.add(seen, 1).or_throw();
  pollfd polled{set_.descriptor().or_throw(), POLLIN, 0};
  EXPECT_EQ(::poll(&polled, 1, 0), 0);
  pose.publish("x").or_throw();
  EXPECT_EQ(::poll(&polled, 1, static_cast<int>(kWait.count())), 1);
  EXPECT_TRUE(seen.try_receive());
  EXPECT_EQ(::poll(&polled, 1, 0), 0);
}

TEST_F(ExecutorTest, ClosedAndForeignHandlesAreAnswered) {
  gimi_handle set = 0;
  gimi_ready ready{};
  std::size_t count = 9;
  std::int32_t descriptor = 0;
  ASSERT_EQ(gimi_wait_set_create(&set), GIMI_OK);
  EXPECT_EQ(gimi_wait_set_create(nullptr), GIMI_BAD_ARGUMENT);
  EXPECT_EQ(gimi_wait_set_add(set, 0, 1), GIMI_CLOSED);
  EXPECT_EQ(gimi_wait_set_add(set, set, 1), GIMI_BAD_ARGUMENT);
  EXPECT_EQ(gimi_wait_set_add(viewer_.c_handle(), set, 1), GIMI_BAD_ARGUMENT);
  EXPECT_EQ(gimi_wait_set_wait(set, nullptr, 1, sizeof ready, 0, &count), GIMI_BAD_ARGUMENT);
  EXPECT_EQ(gimi_wait_set_wait(set, &ready, 0, sizeof ready, 0, &count), GIMI_BAD_ARGUMENT);
  EXPECT_EQ(gimi_wait_set_wait(set, &ready, 1, 0, 0, &count), GIMI_BAD_ARGUMENT);
  EXPECT_EQ(gimi_wait_set_wait(set, &ready, 1, std::size_t{1} << 32, 0, &count), GIMI_BAD_ARGUMENT);
  EXPECT_EQ(gimi_wait_set_descriptor(set, nullptr), GIMI_BAD_ARGUMENT);
  EXPECT_EQ(gimi_wait_set_wait(set, &ready, 1, sizeof ready, 0, &count), GIMI_TIMEOUT);
  EXPECT_EQ(count, 0u);
  EXPECT_EQ(gimi_wait_set_wake(set), GIMI_OK);
  EXPECT_EQ(gimi_close(set), GIMI_OK);
  EXPECT_EQ(gimi_close(set), GIMI_CLOSED);
  EXPECT_EQ(gimi_wait_set_add(set, viewer_.c_handle(), 1), GIMI_CLOSED);
  EXPECT_EQ(gimi_wait_set_remove(set, viewer_.c_handle()), GIMI_CLOSED);
  EXPECT_EQ(gimi_wait_set_wake(set), GIMI_CLOSED);
  EXPECT_EQ(gimi_wait_set_descriptor(set, &descriptor), GIMI_CLOSED);
  EXPECT_EQ(descriptor, -1);
}

TEST_F(ExecutorTest, CallsBackForWhatComesUntilItIsStopped) {
  auto [pose, seen] = pair("pose");
  const Answers answers = robot_.answer("add").or_throw();
  std::string told;
  executor_.on(seen, [&](const Message& message) { told += message.text(); }).or_throw();
  executor_.on(answers, [&](Request request) { request.reply("3").or_throw(); }).or_throw();
  executor_
      .on(viewer_.request_later("robot/add", "1 2", kWait).or_throw(),
          [&](const Reply& reply) {
            told += reply.text();
            pose.publish("a").or_throw();
            pose.publish("b").or_throw();
          })
      .or_throw();
  int ticks = 0;
  executor_.every(Timeout{1}, [&] {
    if (told == "3ab" && ++ticks == 3) executor_.stop();
  });
  executor_.run().or_throw();
  EXPECT_EQ(told, "3ab");
  EXPECT_EQ(ticks, 3);
}

TEST_F(ExecutorTest, LeavesOutTheCallsThatWereMissed) {
  constexpr std::chrono::milliseconds kPeriod{20};
  const auto begin = std::chrono::steady_clock::now();
  std::vector<std::chrono::steady_clock::time_point> called;
  executor_.every(kPeriod, [&] {
    called.push_back(std::chrono::steady_clock::now());
    if (called.size() == 3) executor_.stop();
    while (called.size() == 1 && std::chrono::steady_clock::now() < called[0] + 7 * kPeriod / 2)
      std::this_thread::yield();
  });
  executor_.run().or_throw();
  EXPECT_GE(called[2], begin + 5 * kPeriod) << "in time again after the second call";
}

TEST_F(ExecutorTest, EndsWhenNothingIsLeftToWaitFor) {
  auto [pose, seen] = pair("pose");
  executor_.on(seen, [&](const Message&) { viewer_.close(); }).or_throw();
  pose.publish("x").or_throw();
  executor_.run().or_throw();
  executor_.run().or_throw();
}

TEST_F(ExecutorTest, AnotherThreadStopsIt) {
  executor_.every(Timeout{60'000}, [] {});
  std::thread stops([&] { executor_.stop(); });
  executor_.run().or_throw();
  stops.join();
}

TEST_F(ExecutorTest, ACallbackMayThrowOrEndItselfAndOthers) {
  auto [pose, seen] = pair("pose");
  auto [image, view] = pair("image");
  std::string told;
  Executor::Id own = 0;
  Executor::Id other = 0;
  own = executor_
            .on(seen,
                [&, name = std::string("a name that is long enough for the heap")](const Message&) {
                  executor_.off(other);
                  executor_.off(own);
                  told += name.substr(0, 6);
                  throw std::runtime_error("thrown");
                })
            .or_throw();
  other = executor_.on(view, [&](const Message&) { told += "never"; }).or_throw();
  pose.publish("x").or_throw();
  EXPECT_THROW(static_cast<void>(executor_.run()), std::runtime_error);
  EXPECT_EQ(told, "a name");
  image.publish("y").or_throw();
  EXPECT_EQ(view.receive(kWait)->text(), "y") << "it is the program's again";
  executor_.run().or_throw();
}

TEST_F(ExecutorTest, ABlockingRequestInACallbackIsRefused) {
  auto [pose, seen] = pair("pose");
  const Answers answers = robot_.answer("add").or_throw();
  executor_
      .on(seen,
          [&](const Message&) {
            const Reply reply = viewer_.request("robot/add", "1 2", kWait);
            EXPECT_TRUE(reply.is(Status::bad_argument));
            EXPECT_NE(reply.failure().sentence.find("request_later()"), std::string::npos);
            EXPECT_TRUE(executor_.run().is(Status::bad_argument)) << "inside itself";
            executor_.stop();
          })
      .or_throw();
  pose.publish("x").or_throw();
  executor_.run().or_throw();
  EXPECT_EQ(viewer_.request("robot/nothing", "1", kNoWait).failure().sentence.find("callback"),
            std::string::npos);
}

// It can be proved that nothing crashes or hangs, and no message is lost, while threads wait by one
// set, and others add, remove and end its members.
TEST_F(ExecutorTest, MembersComeAndGoWhileOthersWait) {
  auto [pose, seen] = pair("pose");
  set_.add(seen, 0).or_throw();
  constexpr int kMessages = 200;
  std::atomic<int> taken = 0;
  std::vector<std::thread> threads;
  for (int i = 0; i < 2; ++i) {
    threads.emplace_back([&] {
      while (taken < kMessages) {
        if (!set_.wait(kWait)) break;
        if (seen.try_receive()) ++taken;
      }
      set_.wake();
    });
    threads.emplace_back([&] {
      for (int round = 0; round < 100; ++round) {
        auto queue = viewer_.queue({static_cast<std::uint32_t>(round), 1});
        static_cast<void>(set_.add(queue, 1));
        if (round % 2 == 0) static_cast<void>(set_.remove(queue));
      }
    });
  }
  for (int i = 0; i < kMessages; ++i) {
    pose.publish("x").or_throw();
    EXPECT_TRUE(test::eventually([&] { return taken >= i; }));
  }
  for (std::thread& thread : threads) thread.join();
  EXPECT_GE(taken, kMessages);
}

TEST_F(ExecutorTest, TheLongestPeriodIsNotOverAtOnce) {
  int calls = 0;
  executor_.every(Timeout::max(), [&] { ++calls; });
  executor_.every(Timeout{20}, [&] { executor_.stop(); });
  EXPECT_TRUE(executor_.run());
  EXPECT_EQ(calls, 0);
}

}  // namespace
}  // namespace gimnet
