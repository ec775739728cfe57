#include "hub/data/egress/gather_writer.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <random>

#include "tests/hub/data/support/egress_rig.hpp"

namespace gimnet::hub {
namespace {

using proto::Kind;
using testing::EgressRig;
using ::testing::ElementsAre;
using ::testing::IsEmpty;
using ::testing::SizeIs;
using testing::TestConnection;

TEST(GatherWriter, WritesLanesByNumber) {
  EgressRig rig;
  TestConnection connection(rig);
  for (const int lane : {3, 1, 2, 0, 1}) {
    rig.push(connection.outbox, std::to_string(lane), {.lane = static_cast<std::uint8_t>(lane)});
  }
  EXPECT_EQ(connection.flush(), Flush::emptied);
  EXPECT_THAT(connection.take(), ElementsAre("0", "1", "1", "2", "3"));
  EXPECT_EQ(connection.peer.send_calls(), 1u);
}

TEST(GatherWriter, GoesOnAtEveryByteOfAPartialWrite) {
  const std::vector<std::string> sent = {"control", "0", "one", "", "two of lane 1", "bulk"};
  std::size_t total = 0;
  for (const std::string& text : sent) total += proto::kHeaderSize + text.size();
  for (std::size_t cut = 1; cut < total; ++cut) {
    EgressRig rig;
    TestConnection connection(rig);
    ASSERT_TRUE(connection.outbox.push_control(EgressRig::bytes("control", {.kind = Kind::ns}),
                                               rig.context));
    rig.push(connection.outbox, "0", {.lane = 0});
    const hub::Run run = rig.run({"one", "", "two of lane 1"});
    connection.outbox.push(run, run.header(), {}, rig.context);
    rig.push(connection.outbox, "bulk", {.lane = 2});
    connection.peer.plan_sends({cut, 0, 1});
    EXPECT_EQ(connection.flush(), Flush::blocked);
    EXPECT_EQ(connection.flush(), Flush::blocked);
    if (cut + 1 < total) {
      EXPECT_EQ(connection.flush(), Flush::blocked);
    }
    EXPECT_EQ(connection.flush(), Flush::emptied);
    EXPECT_EQ(connection.take(), sent) << cut;
    EXPECT_EQ(rig.tally.delivered, 5u);
    EXPECT_TRUE(rig.ledger_exact());
  }
}

TEST(GatherWriter, WhatComesLaterGoesBehindTheFrameThatWasBegunOnly) {
  EgressRig rig;
  TestConnection connection(rig);
  const hub::Run run = rig.run({"bulk one", "bulk two"}, {.lane = 2});
  connection.outbox.push(run, run.header(), {}, rig.context);
  connection.peer.plan_sends({20});
  connection.flush();
  EXPECT_TRUE(connection.writer.in_frame());
  rig.push(connection.outbox, "real-time", {.lane = 0});
  ASSERT_TRUE(
      connection.outbox.push_control(EgressRig::bytes("control", {.kind = Kind::ns}), rig.context));
  EXPECT_EQ(connection.flush(), Flush::emptied);
  EXPECT_THAT(connection.take(), ElementsAre("bulk one", "control", "real-time", "bulk two"));
}

TEST(GatherWriter, AWaitingLaneGetsASixteenthOfTheBytes) {
  EgressRig rig;
  TestConnection connection(rig);
  connection.peer.set_room(0);
  for (int i = 0; i < 100; ++i) {
    rig.push(connection.outbox, std::string(4'080, '0'),
             {.lane = 0, .src = static_cast<std::uint32_t>(i % 2)});
    rig.push(connection.outbox, std::string(4'080, '3'),
             {.lane = 3, .src = static_cast<std::uint32_t>(i % 2)});
  }
  connection.flush();
  connection.peer.set_room(200 * 1'024);
  connection.flush();
  std::size_t low = 0;
  const auto texts = connection.take();
  for (const std::string& text : texts) low += text[0] == '3' ? 1 : 0;
  EXPECT_GE(low, texts.size() / 16 - 1);
  EXPECT_LE(low, texts.size() / 12);
}

TEST(GatherWriter, BulkBeforeARealTimeMessageIsAtMostOneBatch) {
  EgressRig rig;
  TestConnection connection(rig);
  connection.peer.set_room(0);
  for (int i = 0; i < 60; ++i) rig.push(connection.outbox, std::string(60'000, 'b'), {.lane = 2});
  connection.flush();
  rig.push(connection.outbox, "now", {.lane = 0});
  connection.peer.set_room(MemoryPeer::kAll);
  connection.flush();
  EXPECT_EQ(connection.take()[0], "now");
}

TEST(GatherWriter, KeepsAnyOrderOfShortWritesLegal) {
  for (std::uint32_t seed = 0; seed < 30; ++seed) {
    std::mt19937 random(seed);
    EgressRig rig;
    TestConnection connection(rig);
    std::vector<std::size_t> plan;
    for (int i = 0; i < 400; ++i) plan.push_back(random() % 200);
    connection.peer.plan_sends(plan);
    std::array<std::vector<std::string>, 4> sent;
    std::array<std::vector<std::string>, 4> got;
    const auto take = [&] {
      for (const std::string& text : connection.take())
        got[static_cast<std::size_t>(text[0] - '0')].push_back(text);
    };
    for (int i = 0; i < 300; ++i) {
      const std::uint32_t lane = static_cast<std::uint32_t>(random() % 4);
      std::string text =
          std::to_string(lane) + "." + std::to_string(i) + std::string(random() % 300, '.');
      rig.push(connection.outbox, text, {.lane = static_cast<std::uint8_t>(lane)});
      sent[lane].push_back(std::move(text));
      if (random() % 3 == 0) connection.flush();
      take();
      ASSERT_TRUE(rig.ledger_exact());
    }
    while (connection.flush() != Flush::emptied) {
    }
    take();
    EXPECT_EQ(got, sent) << "seed " << seed;
    EXPECT_EQ(rig.tally.queued, 0);
  }
}

TEST(GatherWriter, KeepsWhatItWroteUntilItIsConfirmed) {
  EgressRig rig;
  TestConnection connection(rig);
  ResumeBuffer resume(1 << 20);
  rig.push(connection.outbox, "one");
  rig.push(connection.outbox, "two");
  EXPECT_EQ(connection.flush(&resume), Flush::emptied);
  EXPECT_EQ(rig.tally.delivered, 0u);
  EXPECT_EQ(resume.written(), 2u);
  EXPECT_EQ(resume.unconfirmed(), 2u);
}

TEST(GatherWriter, WaitsForAConfirmWhenTheResumeBufferIsFull) {
  EgressRig rig;
  TestConnection connection(rig);
  ResumeBuffer resume(100);
  for (int i = 0; i < 5; ++i) rig.push(connection.outbox, std::string(34, 'x'));
  EXPECT_EQ(connection.flush(&resume), Flush::waits);
  EXPECT_THAT(connection.take(), SizeIs(2)) << "2 x 50 bytes: exactly the limit";
  EXPECT_EQ(connection.flush(&resume), Flush::waits);
  EXPECT_EQ(resume.confirm(1), 1u);
  EXPECT_EQ(connection.flush(&resume), Flush::waits);
  EXPECT_THAT(connection.take(), SizeIs(1));
}

TEST(GatherWriter, AFrameLargerThanTheResumeBufferIsKeptAlone) {
  EgressRig rig;
  TestConnection connection(rig);
  ResumeBuffer resume(100);
  rig.push(connection.outbox, std::string(500, 'x'));
  rig.push(connection.outbox, std::string(500, 'y'));
  EXPECT_EQ(connection.flush(&resume), Flush::waits);
  EXPECT_THAT(connection.take(), SizeIs(1));
  EXPECT_EQ(resume.confirm(1), 1u);
  EXPECT_EQ(connection.flush(&resume), Flush::emptied);
}

TEST(GatherWriter, TellsOfAFailure) {
  EgressRig rig;
  TestConnection connection(rig);
  rig.push(connection.outbox, "one");
  connection.peer.reset();
  EXPECT_EQ(connection.writer.flush(connection.outbox, nullptr, *connection.transport, rig.context),
            Flush::failed);
  EXPECT_EQ(rig.tally.queued, 1);
}

TEST(GatherWriter, WritesNoMoreThanItsShareOfATurn) {
  EgressRig rig;
  TestConnection connection(rig);
  for (int i = 0; i < 60; ++i) {
    rig.push(connection.outbox, std::string(60'000, 'b'),
             {.lane = static_cast<std::uint8_t>(i % 4), .src = 5});
  }
  EXPECT_EQ(connection.flush(), Flush::more);
  EXPECT_LE(connection.peer.readable(), 5u * (256 + 64) * 1'024);
  while (connection.flush() == Flush::more) {
  }
  EXPECT_THAT(connection.take(), SizeIs(60));
}

}  // namespace
}  // namespace gimnet::hub
