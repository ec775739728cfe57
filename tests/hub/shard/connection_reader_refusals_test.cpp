#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cstring>

#include "hub/shard/connection_reader.hpp"
#include "tests/hub/shard/support/hub_rig.hpp"

// Frames that close their connection, and what becomes of those before them.

namespace gimnet::hub {
namespace {

using proto::DropReason;
using proto::GoodbyeCode;
using proto::Kind;
using ::testing::ElementsAre;
using testing::FakeNode;
using testing::FrameSpec;
using testing::HubRig;
using ::testing::IsEmpty;
using ::testing::SizeIs;

TEST(ConnectionReader, CarriesTheLargestFrameAndRefusesOneByteMore) {
  HubRig rig;
  FakeNode& a = rig.join(0);
  FakeNode& b = rig.join(0);
  const std::string largest(65'536, 'x');
  rig.send(a, b.id.value(), largest);
  rig.settle();
  ASSERT_THAT(b.frames, SizeIs(1));
  EXPECT_EQ(b.frames[0].text(), largest);
  rig.send(a, b.id.value(), largest + "y");
  rig.settle();
  ASSERT_TRUE(a.goodbye);
  EXPECT_EQ(a.goodbye->code, GoodbyeCode::malformed);
  EXPECT_EQ(rig.dropped(DropReason::malformed), 1u);
  EXPECT_EQ(rig.sum(&ShardCounters::malformed), 1u);
  EXPECT_TRUE(a.pipe.transport_gone());
}

TEST(ConnectionReader, ClosesForALengthThatClaimsFourGiB) {
  for (const std::uint32_t length :
       {65'537u, 0x7FFF'FFFFu, 0x8000'0000u, 0xFFFF'FFF0u, 0xFFFF'FFFFu}) {
    HubRig rig;
    FakeNode& a = rig.join(0);
    FakeNode& b = rig.join(0);
    std::vector<std::byte> bytes = HubRig::frame(a, b.id.value(), "x");
    std::memcpy(bytes.data(), &length, sizeof length);
    rig.write(a, bytes);
    rig.settle();
    ASSERT_TRUE(a.goodbye) << length;
    EXPECT_EQ(a.goodbye->code, GoodbyeCode::malformed);
    EXPECT_THAT(b.frames, IsEmpty());
  }
}

TEST(ConnectionReader, ClosesAConnectionThatSpeaksForAnother) {
  HubRig rig;
  FakeNode& a = rig.join(0);
  FakeNode& b = rig.join(0);
  rig.send(a, b.id.value(), "mine");
  rig.send(a, b.id.value(), "not mine", {.src = b.id.value()});
  rig.send(a, b.id.value(), "after it");
  rig.settle();
  EXPECT_THAT(b.texts(), ElementsAre("mine"));
  ASSERT_TRUE(a.goodbye);
  EXPECT_EQ(a.goodbye->code, GoodbyeCode::wrong_source);
  EXPECT_EQ(rig.dropped(DropReason::wrong_source), 1u);
  EXPECT_EQ(rig.sum(&ShardCounters::wrong_source), 1u);
  const auto detached = rig.take_detached();
  ASSERT_TRUE(detached);
  EXPECT_EQ(detached->code, GoodbyeCode::wrong_source);
  EXPECT_FALSE(detached->said_by_peer);
}

struct Malformed {
  const char* what;
  FrameSpec spec;
  std::uint32_t dst;
  std::string payload;
};

std::string ids(std::initializer_list<std::uint32_t> values) {
  std::string text(4 * values.size(), '\0');
  std::memcpy(text.data(), std::data(values), text.size());
  return text;
}

std::string fragment(std::uint32_t offset, std::uint32_t total, const std::string& payload) {
  return ids({1, offset, total}) + payload;
}

TEST(ConnectionReader, AnswersEachMalformedFrameWithGoodbye) {
  const Malformed cases[] = {
      {"reserved flag", {.flags = 0x40}, 1, ""},
      {"reserved flag 2", {.flags = 0x80}, 1, ""},
      {"reserved lane bit", {.lane = 4}, 1, ""},
      {"reserved lane bits", {.lane = 0x80}, 1, ""},
      {"kind 20", {.kind = static_cast<Kind>(20)}, 1, ""},
      {"kind 255", {.kind = static_cast<Kind>(255)}, 1, ""},
      {"a node's REPORT", {.kind = Kind::report}, 1, ""},
      {"a node's ROUTE", {.kind = Kind::route}, 1, ""},
      {"BLOCK on GROUP", {.kind = Kind::group, .flags = 1}, 1, ""},
      {"BLOCK on LIST", {.kind = Kind::list, .flags = 1}, 1, ids({1})},
      {"BLOCK on BROADCAST", {.kind = Kind::broadcast, .flags = 1}, 0xFFFFFFFF, ""},
      {"LATEST without key", {.flags = 3}, 1, ""},
      {"LATEST SERVICE without key", {.kind = Kind::service, .flags = 3}, 1, ""},
      {"key too short", {.flags = 0x20}, 1, "1234567"},
      {"LIST of none", {.kind = Kind::list}, 0, ""},
      {"LIST of 1025", {.kind = Kind::list}, 1025, std::string(4 * 1025, '\0')},
      {"LIST too short", {.kind = Kind::list}, 2, ids({1})},
      {"LIST unsorted", {.kind = Kind::list}, 2, ids({2, 1})},
      {"LIST repeated", {.kind = Kind::list}, 2, ids({2, 2})},
      {"EXT too short", {.flags = 0x10}, 1, "\x01"},
      {"EXT beyond the end", {.flags = 0x10}, 1, std::string("\x05\x00\x00\x02", 4)},
      {"fragment header too short", {.flags = 8}, 1, "12345678901"},
      {"fragment without payload", {.flags = 8}, 1, fragment(0, 10, "")},
      {"fragment over its total", {.flags = 8}, 1, fragment(8, 10, "abc")},
      {"fragment that wraps", {.flags = 8}, 1, fragment(0xFFFFFFFF, 10, "abc")},
      {"FLOW of unknown operation", {.kind = Kind::flow}, 0, std::string(24, '\x63')},
      {"FLOW too short", {.kind = Kind::flow}, 0, "\x01"},
      {"FLOW for somebody else",
       {.kind = Kind::flow},
       1,
       std::string("\x01\0\0\0", 4) + std::string(12, '\0')},
      {"LINK for somebody else", {.kind = Kind::link}, 1, "junk"},
      {"LINK that is no GOODBYE", {.kind = Kind::link}, 0, "junk"},
  };
  for (const Malformed& each : cases) {
    HubRig rig;
    FakeNode& a = rig.join(0);
    FakeNode& b = rig.join(0);
    rig.send(a, b.id.value(), "before");
    rig.send(a, each.dst, each.payload, each.spec);
    rig.send(a, b.id.value(), "after");
    rig.settle();
    ASSERT_TRUE(a.goodbye) << each.what;
    EXPECT_EQ(a.goodbye->code, GoodbyeCode::malformed) << each.what;
    EXPECT_THAT(b.texts(), ElementsAre("before")) << each.what;
    EXPECT_EQ(rig.dropped(DropReason::malformed), 1u) << each.what;
    EXPECT_EQ(rig.sum(&ShardCounters::malformed), 1u) << each.what;
    EXPECT_EQ(rig.ledger().queued, 0u) << each.what;
  }
}

TEST(ConnectionReader, RefusesHopsFromANode) {
  HubRig rig;
  FakeNode& a = rig.join(0);
  std::vector<std::byte> bytes = HubRig::frame(a, a.id.value(), "x");
  bytes[14] = std::byte{1};
  rig.write(a, bytes);
  rig.settle();
  ASSERT_TRUE(a.goodbye);
  EXPECT_EQ(a.goodbye->code, GoodbyeCode::malformed);
}

// Frames before a malformed one were legal when they came, also where all have one header.
TEST(ConnectionReader, DeliversTheFramesBeforeAMalformedOneOfTheSameHeader) {
  HubRig rig;
  FakeNode& a = rig.join(0);
  FakeNode& b = rig.join(0);
  const FrameSpec keyed{.flags = proto::kFlagKeyed};
  rig.send(a, b.id.value(), "12345678one", keyed);
  rig.send(a, b.id.value(), "12345678two", keyed);
  rig.send(a, b.id.value(), "short", keyed);
  rig.send(a, b.id.value(), "12345678not", keyed);
  rig.settle();
  EXPECT_THAT(b.texts(), ElementsAre("12345678one", "12345678two"));
  ASSERT_TRUE(a.goodbye);
  EXPECT_EQ(rig.ledger().accepted, 3u);
  EXPECT_EQ(rig.dropped(DropReason::malformed), 1u);
}

}  // namespace
}  // namespace gimnet::hub
