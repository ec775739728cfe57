#include "hub/shard/connection_reader.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cstring>

#include "base/clock.hpp"
#include "proto/frame/extensions.hpp"
#include "proto/frame/frame_builder.hpp"
#include "tests/hub/shard/support/hub_rig.hpp"

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

TEST(ConnectionReader, CarriesFramesFromOneNodeToAnother) {
  HubRig rig;
  FakeNode& a = rig.join(0);
  FakeNode& b = rig.join(0);
  rig.send(a, b.id.value(), "one");
  rig.send(a, b.id.value(), "");
  rig.send(a, b.id.value(), "three", {.lane = 0});
  rig.settle();
  // Lane 0 goes first.
  EXPECT_THAT(b.texts(), ElementsAre("three", "one", ""));
  EXPECT_EQ(b.frames[1].header.src, a.id.value());
  EXPECT_EQ(rig.ledger().delivered, 3u);
  EXPECT_EQ(rig.ledger().queued, 0u);
}

TEST(ConnectionReader, GivesTheSameFramesHoweverTheBytesAreSplit) {
  for (const std::size_t split : {1u, 2u, 3u, 7u, 15u, 16u, 17u, 100u}) {
    HubRig rig;
    FakeNode& a = rig.join(0);
    FakeNode& b = rig.join(0);
    std::vector<std::string> sent;
    for (std::size_t size : {0u, 1u, 15u, 16u, 17u, 300u, 1100u}) {
      sent.push_back(std::string(size, static_cast<char>('a' + size % 26)));
      rig.send(a, b.id.value(), sent.back());
    }
    a.pipe.plan_receives(std::vector<std::size_t>(3000, split));
    rig.settle();
    EXPECT_EQ(b.texts(), sent) << "split " << split;
  }
}

// Its sender's clock is an hour ahead: it may be as old as it says, and not an hour older.
TEST(ConnectionReader, TakesAnAgeFromTheFutureForNow) {
  HubRig rig;
  FakeNode& a = rig.join(0);
  FakeNode& b = rig.join(0);
  constexpr std::int64_t kHourNs = 3'600'000'000'000;
  std::byte memory[64];
  proto::ExtensionWriter writer(memory);
  ASSERT_TRUE(writer.add_age({wall_now_ns() + kHourNs, 250}));
  proto::FrameParts parts;
  parts.header.dst = b.id.value();
  parts.header.src = a.id.value();
  parts.extensions = writer.written();
  std::byte bytes[256];
  const std::size_t size = proto::write_frame(parts, std::as_bytes(std::span("hello", 5)), bytes);
  rig.write(a, {bytes, size});
  rig.settle();
  ASSERT_THAT(b.frames, SizeIs(1));
  std::vector<std::byte> whole(proto::kHeaderSize);
  proto::store_header(whole.data(), b.frames[0].header);
  whole.insert(whole.end(), b.frames[0].body.begin(), b.frames[0].body.end());
  const auto frame = proto::parse_frame(whole, proto::Origin::hub);
  ASSERT_TRUE(frame);
  const auto age = proto::find_age(frame->extensions);
  ASSERT_TRUE(age);
  EXPECT_LE(age->origin_ns, wall_now_ns());
  EXPECT_EQ(age->longest_ms, 250u);
}

TEST(ConnectionReader, FillsInTraceAndCarriesWhatItDoesNotKnow) {
  HubRig rig;
  FakeNode& a = rig.join(0);
  FakeNode& b = rig.join(0);
  std::byte memory[128];
  proto::ExtensionWriter writer(memory);
  ASSERT_TRUE(
      writer.add(static_cast<proto::ExtensionType>(200), std::as_bytes(std::span("unknown", 7))));
  ASSERT_TRUE(writer.add_trace(2));
  proto::FrameParts parts;
  parts.header.dst = b.id.value();
  parts.header.src = a.id.value();
  parts.extensions = writer.written();
  std::byte bytes[256];
  const std::size_t size = proto::write_frame(parts, std::as_bytes(std::span("hello", 5)), bytes);
  rig.write(a, {bytes, size});
  rig.settle();
  ASSERT_THAT(b.frames, SizeIs(1));
  std::vector<std::byte> whole(proto::kHeaderSize);
  proto::store_header(whole.data(), b.frames[0].header);
  whole.insert(whole.end(), b.frames[0].body.begin(), b.frames[0].body.end());
  const auto frame = proto::parse_frame(whole, proto::Origin::hub);
  ASSERT_TRUE(frame);
  const auto trace = proto::find_trace(frame->extensions);
  ASSERT_TRUE(trace);
  EXPECT_EQ(trace->used(), 1u);
  EXPECT_EQ(trace->slot(0).hub, rig.hub());
  EXPECT_GT(trace->slot(0).arrival_ns, 0);
  EXPECT_GE(trace->slot(0).departure_ns, trace->slot(0).arrival_ns);
  EXPECT_EQ(static_cast<char>(frame->extensions[2]), 'u');
}

std::string fragment(std::uint32_t message, std::uint32_t offset, std::uint32_t total,
                     std::size_t size) {
  std::string bytes(proto::kFragmentHeaderSize + size, 'x');
  proto::store_fragment_header(reinterpret_cast<std::byte*>(bytes.data()),
                               {message, offset, total});
  return bytes;
}

// A message that goes on in another lane than it began in could not be put together.
TEST(ConnectionReader, MovesARealTimeMessageToLane1WholeOrNotAtAll) {
  Limits limits;
  limits.lane0_bytes_per_s = 20'280;  // 2,028 in 100 ms: one of the messages
  HubRig rig(1, limits);
  FakeNode& a = rig.join(0);
  FakeNode& b = rig.join(0);
  const FrameSpec spec{.flags = proto::kFlagFragment, .lane = 0};
  for (std::uint32_t part = 0; part < 4; ++part) {
    rig.send(a, b.id.value(), fragment(1, part * 500, 2'000, 500), spec);
    rig.settle();
  }
  for (std::uint32_t part = 0; part < 4; ++part) {
    rig.send(a, b.id.value(), fragment(2, part * 500, 2'000, 500), spec);
    rig.settle();
    if (part == 1) rig.pass_ms(1'500);  // the rate is fine again in the middle of it
  }
  rig.pass_ms(1'500);
  rig.send(a, b.id.value(), fragment(3, 0, 500, 500), spec);
  rig.settle();
  std::vector<int> lanes;
  for (const auto& frame : b.frames) lanes.push_back(frame.header.lane);
  EXPECT_THAT(lanes, ::testing::ElementsAre(0, 0, 0, 0, 1, 1, 1, 1, 0));
}

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
