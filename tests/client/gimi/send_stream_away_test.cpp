#include <gtest/gtest.h>

#include <thread>

#include "base/clock.hpp"
#include "client/gimi/send_stream.hpp"
#include "tests/client/gimi/support/conversation.hpp"

// Streams to a service of which the program is away.

namespace gimnet::gimi {
namespace {

using test::kAll;

constexpr ServicePlace kThere{.group = 9, .provider = 18, .session = 3, .key = {}, .accepts = true};

ServicePlace away() {
  ServicePlace place = kThere;
  place.away = true;
  return place;
}

class SendStreamAway : public ::testing::Test {
 protected:
  SendStreamAway() { uplink_.open(connected_.node.get()); }
  ~SendStreamAway() override { connected_.hub.close(); }

  struct Keeper final : StreamKeeper {
    void watch(SendStream& /*stream*/) override {}
  } keeper_;
  test::FakeHub hub_;
  nif::test::Connected connected_ =
      nif::test::connect_to(hub_, nif::test::default_options(), nif::test::make_welcome());
  Uplink uplink_;
};

std::string sentence_of(const Outcome<void>& outcome) {
  return outcome ? "" : outcome.failure().sentence;
}

TEST_F(SendStreamAway, SaysSoAtOnce) {
  SendStream stream(uplink_, keeper_, "robot/drive", away(), {});
  const auto refused = stream.send("1", kForever, More::no);
  EXPECT_TRUE(refused.is(Status::not_found));
  EXPECT_EQ(sentence_of(refused), "not sent to robot/drive: robot/drive is away");
  stream.on_moved(kThere);
  stream.send("2", kForever, More::no).or_throw();
  stream.on_moved(away());
  EXPECT_EQ(sentence_of(stream.send("3", kForever, More::no)),
            "not sent to robot/drive: robot/drive is away since 0 s");
  EXPECT_EQ(stream.counts().sent, 1u);
}

TEST_F(SendStreamAway, WaitsWithinItsTimeWhereThatIsAskedFor) {
  SendStream stream(uplink_, keeper_, "robot/drive", away(), {});
  const auto late = stream.send("1", kNoWait, More::no, AtAway::wait);
  EXPECT_TRUE(late.is(Status::timeout));
  EXPECT_EQ(sentence_of(late), "not sent to robot/drive: robot/drive is away");
  std::thread waiting([&] { stream.send("2", kForever, More::no, AtAway::wait).or_throw(); });
  stream.on_moved(kThere);
  waiting.join();
  EXPECT_EQ(stream.counts().sent, 1u);
}

TEST_F(SendStreamAway, AMessageToBeConfirmedIsRefusedOrWaitsAsAnyOther) {
  SendStream stream(uplink_, keeper_, "robot/drive", away(), {});
  constexpr Timeout kPatience{10'000};  // for a message that goes, which nobody acknowledges here
  EXPECT_TRUE(stream.send_confirmed("1", kPatience).is(Status::not_found));
  EXPECT_TRUE(stream.send_confirmed("2", kNoWait, AtAway::wait).is(Status::timeout));
  EXPECT_EQ(stream.counts().sent, 0u);
}

TEST_F(SendStreamAway, WhoWaitsIsToldThatTheServiceHasGone) {
  SendStream stream(uplink_, keeper_, "robot/drive", away(), {});
  std::thread waiting([&] {
    EXPECT_TRUE(stream.send("1", kForever, More::no, AtAway::wait).is(Status::not_found));
  });
  stream.on_moved({});
  waiting.join();
  EXPECT_EQ(stream.counts().sent, 0u);
}

// The same program goes on, and acknowledges what it got.
TEST_F(SendStreamAway, WhatIsOnItsWayIsNotLost) {
  SendOptions options;
  options.window = 2;
  SendStream stream(uplink_, keeper_, "robot/drive", kThere, options);
  stream.send("1", kForever, More::no).or_throw();
  const std::uint32_t epoch = stream.epoch();
  stream.on_moved(away());
  stream.on_moved(kThere);
  EXPECT_EQ(stream.epoch(), epoch);
  EXPECT_EQ(stream.counts().waiting, 1u);
  static_cast<void>(stream.on_ack(1, {kAll, 0, 0}));
  EXPECT_EQ(stream.counts().acknowledged, 1u);
  EXPECT_EQ(stream.counts().lost, 0u);
}

TEST_F(SendStreamAway, AMessageThatIsHeldIsHeldOn) {
  SendOptions options;
  options.window = 1;
  options.at_full = AtFullWindow::hold_latest;
  SendStream stream(uplink_, keeper_, "robot/drive", kThere, options);
  stream.send("1", kForever, More::no).or_throw();
  stream.send("2", kForever, More::no).or_throw();
  stream.on_moved(away());
  static_cast<void>(stream.on_ack(1, {kAll, 0, 0}));
  EXPECT_TRUE(stream.tick(steady_now_ns()));
  EXPECT_EQ(stream.counts().sent, 1u);
  stream.on_moved(kThere);
  EXPECT_TRUE(stream.tick(steady_now_ns()));
  EXPECT_EQ(stream.counts().sent, 2u);
}

}  // namespace
}  // namespace gimnet::gimi
