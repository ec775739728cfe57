#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "hub/data/egress/outbox.hpp"
#include "tests/hub/data/support/egress_rig.hpp"

// Control frames in an outbox: before all lanes, and bounded.

namespace gimnet::hub {
namespace {

using proto::Kind;
using testing::EgressRig;
using ::testing::SizeIs;
using testing::TestConnection;

constexpr std::uint32_t kKiB = 1024;

/// A payload that makes a frame of exactly `size` bytes.
std::string sized(std::uint32_t size, char fill) {
  return std::string(size - proto::kHeaderSize, fill);
}

TEST(Outbox, ControlGoesFirstAndIsBounded) {
  Limits limits;
  limits.control_bytes = 16 * kKiB;
  EgressRig rig(limits);
  TestConnection connection(rig);
  rig.push(connection.outbox, "data", {.lane = 0});
  const auto control = EgressRig::bytes(sized(kKiB, 'c'), {.kind = Kind::ns});
  for (int i = 0; i < 16; ++i) EXPECT_TRUE(connection.outbox.push_control(control, rig.context));
  EXPECT_FALSE(connection.outbox.push_control(control, rig.context));
  connection.flush();
  const auto texts = connection.take();
  ASSERT_THAT(texts, SizeIs(17));
  EXPECT_EQ(texts[0][0], 'c');
  EXPECT_EQ(texts[16], "data");
  EXPECT_TRUE(connection.outbox.push_control(control, rig.context)) << "there is room again";
}

TEST(Outbox, WhatANewConnectionGetsFirstDoesNotCountAgainstTheBoundOfControl) {
  Limits limits;
  limits.control_bytes = 16 * kKiB;
  EgressRig rig(limits);
  TestConnection connection(rig);
  rig.push(connection.outbox, "data", {.lane = 0});
  const auto event = EgressRig::bytes(sized(kKiB, 'e'), {.kind = Kind::ns});
  std::vector<std::byte> events;
  for (int i = 0; i < 100; ++i) events.insert(events.end(), event.begin(), event.end());
  connection.outbox.push_first_control(events, rig.context);
  const auto control = EgressRig::bytes(sized(kKiB, 'c'), {.kind = Kind::ns});
  for (int i = 0; i < 16; ++i) EXPECT_TRUE(connection.outbox.push_control(control, rig.context));
  EXPECT_FALSE(connection.outbox.push_control(control, rig.context));
  while (connection.flush() != Flush::emptied) {
  }
  const auto texts = connection.take();
  ASSERT_THAT(texts, SizeIs(117));
  EXPECT_EQ(texts[0][0], 'e');
  EXPECT_EQ(texts[99][0], 'e');
  EXPECT_EQ(texts[100][0], 'c');
  EXPECT_EQ(texts[116], "data");
  for (int i = 0; i < 16; ++i) EXPECT_TRUE(connection.outbox.push_control(control, rig.context));
  EXPECT_FALSE(connection.outbox.push_control(control, rig.context))
      << "what left makes no room twice";
}

TEST(Outbox, WhatAConnectionWasToGetFirstGoesWithIt) {
  Limits limits;
  limits.control_bytes = 16 * kKiB;
  EgressRig rig(limits);
  TestConnection connection(rig);
  const auto event = EgressRig::bytes(sized(17 * kKiB, 'e'), {.kind = Kind::ns});
  connection.outbox.push_first_control(event, rig.context);
  connection.outbox.clear_control();
  EXPECT_TRUE(connection.outbox.empty());
  const auto control = EgressRig::bytes(sized(16 * kKiB, 'c'), {.kind = Kind::ns});
  EXPECT_TRUE(connection.outbox.push_control(control, rig.context));
  EXPECT_FALSE(
      connection.outbox.push_control(EgressRig::bytes("x", {.kind = Kind::ns}), rig.context));
}

}  // namespace
}  // namespace gimnet::hub
