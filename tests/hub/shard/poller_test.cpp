#include "hub/shard/poller.hpp"

#include <gtest/gtest.h>
#include <sys/socket.h>
#include <unistd.h>

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

TEST_F(PollerTest, RefusesWhatTheKernelRefuses) {
  EXPECT_FALSE(poller.add(-1, 1, {.read = true}));
  ASSERT_TRUE(poller.add(ends[0], 1, {}));
  EXPECT_FALSE(poller.add(ends[0], 1, {})) << "twice";
}

}  // namespace
}  // namespace gimnet::hub
