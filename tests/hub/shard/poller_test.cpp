#include "hub/shard/poller.hpp"

#include <gtest/gtest.h>
#include <sys/socket.h>
#include <unistd.h>

#include "base/clock.hpp"

namespace gimnet::hub {
namespace {

class PollerTest : public ::testing::Test {
 protected:
  PollerTest() { EXPECT_EQ(::socketpair(AF_UNIX, SOCK_STREAM | SOCK_NONBLOCK, 0, ends), 0); }
  ~PollerTest() override {
    ::close(ends[0]);
    if (ends[1] >= 0) ::close(ends[1]);
  }
  void write_one() { ASSERT_EQ(::write(ends[1], "x", 1), 1); }
  Poller poller;
  int ends[2];
};

TEST_F(PollerTest, TellsWhatIsReady) {
  ASSERT_TRUE(poller.add(ends[0], 42, {.read = true}));
  EXPECT_TRUE(poller.wait(0).empty());
  write_one();
  for (int again = 0; again < 2; ++again) {
    const auto ready = poller.wait(1'000);
    ASSERT_EQ(ready.size(), 1u) << "level-triggered";
    EXPECT_EQ(ready[0].token, 42u);
    EXPECT_TRUE(ready[0].readable);
    EXPECT_FALSE(ready[0].writable);
  }
}

TEST_F(PollerTest, TellsOnlyWhatIsAskedFor) {
  ASSERT_TRUE(poller.add(ends[0], 1, {}));
  write_one();
  EXPECT_TRUE(poller.wait(0).empty());
  poller.change(ends[0], 1, {.write = true});
  auto ready = poller.wait(1'000);
  ASSERT_EQ(ready.size(), 1u);
  EXPECT_TRUE(ready[0].writable);
  EXPECT_FALSE(ready[0].readable);
  poller.remove(ends[0]);
  EXPECT_TRUE(poller.wait(0).empty());
}

TEST_F(PollerTest, AClosedPeerShowsAsReadable) {
  ASSERT_TRUE(poller.add(ends[0], 1, {.read = true}));
  ::close(ends[1]);
  ends[1] = -1;
  const auto ready = poller.wait(1'000);
  ASSERT_EQ(ready.size(), 1u);
  EXPECT_TRUE(ready[0].readable);
}

TEST_F(PollerTest, TellsAnEndOnceToWhoWaitsForNothing) {
  ASSERT_TRUE(poller.add(ends[0], 1, {}));
  write_one();
  ::close(ends[1]);
  ends[1] = -1;
  EXPECT_LE(poller.wait(1'000).size(), 1u);
  for (int again = 0; again < 3; ++again) EXPECT_TRUE(poller.wait(0).empty());
  poller.change(ends[0], 1, {.read = true});
  for (int again = 0; again < 2; ++again) {
    const auto ready = poller.wait(1'000);
    ASSERT_EQ(ready.size(), 1u) << "what it sent is still there";
    EXPECT_TRUE(ready[0].readable);
  }
  poller.change(ends[0], 1, {});
  EXPECT_LE(poller.wait(0).size(), 1u);
  EXPECT_TRUE(poller.wait(0).empty());
}

std::uint64_t now_ms() { return static_cast<std::uint64_t>(steady_now_ns() / 1'000'000); }

TEST_F(PollerTest, WaitsUntilATimeAndNoLonger) {
  for (int round = 0; round < 3; ++round) {
    const std::uint64_t at = now_ms() + 5;
    EXPECT_TRUE(poller.wait_until(at).empty());
    EXPECT_GE(now_ms(), at);
  }
  EXPECT_TRUE(poller.wait_until(now_ms() - 1'000).empty()) << "a time that has passed";
  EXPECT_TRUE(poller.wait_until(Poller::kNow).empty());
}

TEST_F(PollerTest, WhatIsReadyEndsAWaitUntilLater) {
  ASSERT_TRUE(poller.add(ends[0], 42, {.read = true}));
  write_one();
  for (const std::uint64_t at : {now_ms() + 600'000, std::uint64_t{Poller::kNever}}) {
    const auto ready = poller.wait_until(at);
    ASSERT_EQ(ready.size(), 1u);
    EXPECT_EQ(ready[0].token, 42u);
  }
}

TEST_F(PollerTest, AnEarlierTimeEndsAWaitUntilALaterOneOnceOnly) {
  ASSERT_TRUE(poller.add(ends[0], 42, {.read = true}));
  write_one();
  const std::uint64_t early = now_ms() + 20;
  EXPECT_EQ(poller.wait_until(early).size(), 1u) << "so that its timer stays set";
  poller.change(ends[0], 42, {});
  const std::uint64_t late = early + 20;
  EXPECT_TRUE(poller.wait_until(late).empty());
  EXPECT_GE(now_ms(), early);
  EXPECT_TRUE(poller.wait_until(late).empty());
  EXPECT_GE(now_ms(), late);
}

TEST_F(PollerTest, ATimerThatWentOffUnheardDoesNotHoldUpTheNext) {
  ASSERT_TRUE(poller.add(ends[0], 42, {.read = true}));
  write_one();
  const std::uint64_t first = now_ms() + 2;
  EXPECT_EQ(poller.wait_until(first).size(), 1u);
  while (now_ms() < first + 2) {
  }
  // Both are ready now, the timer and the descriptor.
  EXPECT_EQ(poller.wait_until(now_ms() + 600'000).size(), 1u) << "the timer is nobody's";
  poller.change(ends[0], 42, {});
  const std::uint64_t second = now_ms() + 5;
  while (now_ms() < second) EXPECT_TRUE(poller.wait_until(second).empty());
}

TEST_F(PollerTest, RefusesWhatTheKernelRefuses) {
  EXPECT_FALSE(poller.add(-1, 1, {.read = true}));
  ASSERT_TRUE(poller.add(ends[0], 1, {}));
  EXPECT_FALSE(poller.add(ends[0], 1, {})) << "twice";
}

}  // namespace
}  // namespace gimnet::hub
