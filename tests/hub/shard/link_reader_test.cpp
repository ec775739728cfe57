#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>

#include "base/clock.hpp"
#include "proto/frame/extensions.hpp"
#include "proto/frame/frame_builder.hpp"
#include "proto/frame/report.hpp"
#include "tests/hub/shard/support/hub_rig.hpp"

// Frames that come over links, and go over them.

namespace gimnet::hub {
namespace {

using proto::DropReason;
using proto::Kind;
using ::testing::ElementsAre;
using testing::FakeNode;
using testing::FrameSpec;
using testing::HubRig;
using ::testing::IsEmpty;
using ::testing::SizeIs;

constexpr HubId kNear{20};
constexpr HubId kFar{30};
constexpr std::uint32_t kSource = make_id<NodeId>(kNear, 3).value();

/// A frame of a node of another hub, after so many links.
std::vector<std::byte> frame_after(std::uint8_t hops, std::uint32_t dst, const std::string& text,
                                   FrameSpec spec = {}, std::uint32_t src = kSource) {
  FakeNode nobody;
  spec.src = src;
  auto bytes = HubRig::frame(nobody, dst, text, spec);
  bytes[proto::kHopsOffset] = static_cast<std::byte>(hops);
  return bytes;
}

TEST(LinkReader, FramesCrossALinkBothWays) {
  for (const std::size_t shard : {0u, 1u}) {
    HubRig rig(2);
    FakeNode& node = rig.join(0);
    FakeNode& link = rig.link(shard, kNear);
    rig.send(node, kSource, "out");
    rig.write(link, frame_after(0, node.id.value(), "in"));
    rig.settle();
    EXPECT_THAT(link.texts(), ElementsAre("out"));
    EXPECT_THAT(node.texts(), ElementsAre("in"));
    EXPECT_EQ(node.frames[0].header.src, kSource);
    EXPECT_EQ(node.frames[0].header.hops, 1);
    EXPECT_EQ(rig.ledger().delivered, 2u);
  }
}

TEST(LinkReader, EveryFrameOfARunCountsItsHop) {
  HubRig rig;
  FakeNode& node = rig.join(0);
  FakeNode& link = rig.link(0, kNear);
  std::vector<std::byte> bytes;
  for (const char* text : {"a", "b", "longer", "c"}) {
    const auto frame = frame_after(4, node.id.value(), text);
    bytes.insert(bytes.end(), frame.begin(), frame.end());
  }
  rig.write(link, bytes);
  rig.settle();
  ASSERT_THAT(node.texts(), ElementsAre("a", "b", "longer", "c"));
  for (const auto& frame : node.frames) EXPECT_EQ(frame.header.hops, 5);
}

/// A frame of a node of another hub that is worth nothing a quarter of a second after its origin.
std::vector<std::byte> aging_frame(std::uint32_t dst, std::int64_t origin_ns) {
  std::byte memory[64];
  proto::ExtensionWriter writer(memory);
  EXPECT_TRUE(writer.add_age({origin_ns, 250}));
  proto::FrameParts parts;
  parts.header.dst = dst;
  parts.header.src = kSource;
  parts.extensions = writer.written();
  std::vector<std::byte> bytes(256);
  bytes.resize(proto::write_frame(parts, std::as_bytes(std::span("hello", 5)), bytes));
  return bytes;
}

TEST(LinkReader, AFrameAgesByTheClockOfTheHubThatItComesFrom) {
  constexpr std::int64_t kHourNs = 3'600'000'000'000;
  HubRig rig;
  FakeNode& node = rig.join(0);
  FakeNode& link = rig.link(0, kNear);
  rig.write(link, aging_frame(node.id.value(), wall_now_ns() - kHourNs));
  rig.settle();
  EXPECT_THAT(node.frames, SizeIs(1)) << "it ages from now on while that clock is not known";
  for (const std::int64_t ahead_ns : {kHourNs, -kHourNs}) {
    rig.command(0, LinkClockCommand{link.session, std::chrono::nanoseconds{ahead_ns}});
    node.frames.clear();
    rig.write(link, aging_frame(node.id.value(), wall_now_ns() + ahead_ns));
    rig.settle();
    EXPECT_THAT(node.frames, SizeIs(1)) << "it is new";
    rig.write(link, aging_frame(node.id.value(), wall_now_ns() + ahead_ns - 2 * 250'000'000));
    rig.settle();
    EXPECT_THAT(node.frames, SizeIs(1)) << "it is too old";
  }
  EXPECT_EQ(rig.dropped(DropReason::too_old), 2u);
}

TEST(LinkReader, AFrameThatCrossed31LinksGoesNoFurther) {
  HubRig rig;
  FakeNode& node = rig.join(0);
  FakeNode& link = rig.link(0, kNear);
  rig.write(link, frame_after(30, node.id.value(), "31 links"));
  rig.write(link, frame_after(31, node.id.value(), "one more"));
  rig.settle();
  EXPECT_THAT(node.texts(), ElementsAre("31 links"));
  EXPECT_EQ(rig.dropped(DropReason::hop_limit), 1u);
}

TEST(LinkReader, AFrameNeverGoesBackToTheHubThatItCameFrom) {
  HubRig rig(2);
  FakeNode& link = rig.link(0, kNear);
  FakeNode& far = rig.link(1, kFar);
  rig.write(link, frame_after(1, make_id<NodeId>(kFar, 1).value(), "through"));
  rig.write(link, frame_after(1, make_id<NodeId>(kNear, 9).value(), "back",
                              {.flags = proto::kFlagReport}));
  rig.settle();
  EXPECT_THAT(far.texts(), ElementsAre("through"));
  EXPECT_THAT(link.texts(), IsEmpty());
  EXPECT_EQ(rig.dropped(DropReason::no_route), 1u);
  const auto reports = link.reports();
  ASSERT_THAT(reports, SizeIs(1)) << "its sender is told";
  EXPECT_EQ(reports[0].reason, DropReason::no_route);
}

TEST(LinkReader, AnUnknownHubIsNoRoute) {
  HubRig rig;
  FakeNode& node = rig.join(0);
  rig.send(node, make_id<NodeId>(kFar, 1).value(), "x", {.flags = proto::kFlagReport});
  rig.settle();
  EXPECT_EQ(rig.dropped(DropReason::no_route), 1u);
  EXPECT_THAT(node.reports(), SizeIs(1));
}

TEST(LinkReader, WhoSpeaksForThisHubIsDroppedAndTheLinkStays) {
  HubRig rig;
  FakeNode& node = rig.join(0);
  FakeNode& link = rig.link(0, kNear);
  rig.write(link, frame_after(0, node.id.value(), "liar", {}, node.id.value()));
  rig.write(link, frame_after(0, node.id.value(), "honest"));
  rig.settle();
  EXPECT_THAT(node.texts(), ElementsAre("honest"));
  EXPECT_FALSE(link.goodbye);
  EXPECT_EQ(rig.dropped(DropReason::wrong_source), 1u);
  const auto headers_told = [&rig] {
    return std::ranges::count_if(rig.take_events(), [](const ShardEvent& event) {
      const auto* frame = std::get_if<ControlFrameEvent>(&event.what);
      return frame != nullptr && frame->frame.size() == proto::kHeaderSize;
    });
  };
  EXPECT_EQ(headers_told(), 1);
  rig.write(link, frame_after(0, node.id.value(), "liar", {}, node.id.value()));
  rig.settle();
  EXPECT_EQ(rig.dropped(DropReason::wrong_source), 2u);
  EXPECT_EQ(headers_told(), 0) << "at most once a second";
  rig.write(link, frame_after(0, 0, "", {.kind = Kind::route}));
  rig.settle();
  EXPECT_EQ(headers_told(), 0) << "a request without an operation is none";
  EXPECT_EQ(rig.sum(&ShardCounters::malformed), 1u);
}

TEST(LinkReader, AFrameThatIsNotUnderstoodIsDroppedAndTheLinkStays) {
  HubRig rig;
  FakeNode& node = rig.join(0);
  FakeNode& link = rig.link(0, kNear);
  rig.write(link, frame_after(0, node.id.value(), "flag", {.flags = 0x40}));
  rig.write(link, frame_after(0, node.id.value(), "short", {.flags = proto::kFlagFragment}));
  rig.write(link, frame_after(0, node.id.value(), "no key", {.flags = proto::kFlagKeyed}));
  rig.write(link, frame_after(0, node.id.value(), "kind", {.kind = static_cast<Kind>(99)}));
  rig.write(link, frame_after(0, node.id.value(), "good"));
  rig.settle();
  EXPECT_THAT(node.texts(), ElementsAre("good"));
  EXPECT_FALSE(link.goodbye);
  EXPECT_EQ(rig.dropped(DropReason::malformed), 3u) << "a kind that nobody knows is no data";
  EXPECT_TRUE(rig.ledger().exact());
}

TEST(LinkReader, AReportNeverGoesBack) {
  HubRig rig;
  FakeNode& link = rig.link(0, kNear);
  FakeNode& far = rig.link(0, kFar);
  const auto report = [&](std::uint32_t to) {
    const std::string payload(proto::kReportSizeMin, '\1');
    rig.write(link, frame_after(3, to, payload, {.kind = Kind::report}));
    rig.settle();
  };
  const auto reports = [](const FakeNode& node) {
    return std::ranges::count(node.kinds, Kind::report);
  };
  report(make_id<NodeId>(kNear, 1).value());
  EXPECT_EQ(reports(link), 0);
  report(make_id<NodeId>(kFar, 1).value());
  ASSERT_EQ(reports(far), 1);
  EXPECT_EQ(far.control.back().header.hops, 4);
}

TEST(LinkReader, InventedSendersOfBlockUseUpNoMoreThanTheReserves) {
  HubRig rig;
  FakeNode& node = rig.join(0);
  FakeNode& link = rig.link(0, kNear);
  node.pipe.set_room(10);
  const std::string big(60'000, 'x');
  for (std::uint32_t i = 0; i < 1'000; ++i) {
    rig.write(link, frame_after(0, node.id.value(), big, {.flags = 1},
                                make_id<NodeId>(kNear, i + 1).value()));
  }
  rig.settle_without_reading();
  EXPECT_GT(rig.dropped(DropReason::queue_full), 0u);
  EXPECT_EQ(rig.dropped(DropReason::over_budget), 0u) << "others have their memory";
}

TEST(LinkReader, PauseGoesToTheSenderBehindTheLink) {
  HubRig rig;
  FakeNode& node = rig.join(0);
  FakeNode& link = rig.link(0, kNear);
  node.pipe.set_room(10);
  const std::string big(30'000, 'x');
  for (int i = 0; i < 200; ++i) rig.write(link, frame_after(0, node.id.value(), big, {.flags = 1}));
  rig.settle_without_reading();
  link.read();
  const auto pauses = link.flow_of<proto::flow::Pause>();
  ASSERT_FALSE(pauses.empty());
  EXPECT_EQ(pauses[0].target.dst, node.id.value());
  EXPECT_EQ(link.control.back().header.kind, Kind::flow);
  bool named = false;
  for (const auto& frame : link.control) named = named || frame.header.dst == kSource;
  EXPECT_TRUE(named) << "on its way it says for whom it is";
  node.pipe.set_room(SIZE_MAX / 2);
  rig.settle();
  EXPECT_FALSE(link.flow_of<proto::flow::Resume>().empty());
}

TEST(LinkReader, OnlyTheNextHopMayPauseASender) {
  HubRig rig;
  FakeNode& node = rig.join(0);
  FakeNode& link = rig.link(0, kNear);
  FakeNode& far = rig.link(0, kFar);
  const auto pause = [&](FakeNode& from, HubId about) {
    std::byte frame[proto::flow::kFrameSizeMax];
    const proto::flow::Target target{Kind::unicast, proto::Lane::normal,
                                     make_id<NodeId>(about, 4).value()};
    const std::size_t size = proto::flow::encode_frame(proto::flow::Pause{target}, from.id, frame);
    proto::FrameHeader header = proto::load_header(frame);
    header.dst = node.id.value();
    proto::store_header(frame, header);
    rig.write(from, {frame, size});
    rig.settle();
  };
  pause(far, kNear);
  EXPECT_THAT(node.flow_of<proto::flow::Pause>(), IsEmpty());
  pause(link, kNear);
  EXPECT_THAT(node.flow_of<proto::flow::Pause>(), SizeIs(1));
}

TEST(LinkReader, AListCrossesEachLinkOnce) {
  for (const std::size_t shard : {0u, 1u}) {
    HubRig rig(2);
    FakeNode& node = rig.join(0);
    FakeNode& here = rig.join(1);
    FakeNode& link = rig.link(shard, kNear);
    std::string ids;
    for (const std::uint32_t id :
         {here.id.value(), make_id<NodeId>(kNear, 3).value(), make_id<NodeId>(kNear, 4).value()})
      ids.append(reinterpret_cast<const char*>(&id), sizeof id);
    rig.send(node, 3, ids + "all of you", {.kind = Kind::list});
    rig.settle();
    EXPECT_THAT(here.texts(), ElementsAre("all of you"));
    ASSERT_THAT(link.frames, SizeIs(1));
    EXPECT_EQ(link.frames[0].header.dst, 2u);
    EXPECT_EQ(link.frames[0].text(), ids.substr(4) + "all of you");
  }
}

TEST(LinkReader, NoBroadcastOfANodeGoesToALinkByItself) {
  HubRig rig;
  FakeNode& node = rig.join(0);
  FakeNode& other = rig.join(0);
  FakeNode& link = rig.link(0, kNear);
  rig.send(node, make_id<NodeId>(hub_of(node.id), kEveryIndex).value(), "x",
           {.kind = Kind::broadcast});
  rig.settle();
  EXPECT_THAT(other.texts(), ElementsAre("x"));
  EXPECT_THAT(link.frames, IsEmpty());
}

/// Group 5 of the hub `kFar`, whose messages come over the link to `parent`.
void publish_away(HubRig& rig, GroupMembers& group, HubId parent,
                  const std::vector<FakeNode*>& members) {
  group.parent = parent;
  group.provider = make_id<NodeId>(kFar, 1);
  group.by_shard.resize(2);
  for (const FakeNode* member : members)
    group.by_shard[member->shard.value()].put({member->session.slot, member->session.generation});
  static_cast<void>(rig.groups().exchange_away(make_id<GroupId>(kFar, 5), &group));
}

TEST(LinkReader, AGroupOfAnotherHubComesFromTheParentAlone) {
  for (const std::size_t shard : {0u, 1u}) {
    HubRig rig(2);
    FakeNode& node = rig.join(0);
    FakeNode& parent = rig.link(shard, kNear);
    FakeNode& child = rig.link(0, HubId{40});
    FakeNode& stranger = rig.link(1, HubId{50});
    GroupMembers group;
    publish_away(rig, group, kNear, {&node, &child});
    const std::uint32_t dst = make_id<GroupId>(kFar, 5).value();
    const std::uint32_t provider = make_id<NodeId>(kFar, 1).value();
    const FrameSpec spec{.kind = Kind::group, .flags = proto::kFlagReport};
    rig.write(parent, frame_after(1, dst, "scan", spec, provider));
    rig.write(stranger, frame_after(1, dst, "another way", spec, provider));
    rig.write(parent, frame_after(1, dst, "of another hub", spec, kSource));
    rig.write(parent, frame_after(1, dst + 1, "nobody's", spec, provider));
    rig.send(node, dst, "not mine", {.kind = Kind::group});
    rig.settle();
    EXPECT_THAT(node.texts(), ElementsAre("scan"));
    EXPECT_THAT(child.texts(), ElementsAre("scan"));
    EXPECT_EQ(child.frames[0].header.hops, 2);
    EXPECT_EQ(rig.dropped(DropReason::no_route), 1u) << "a loss, where the parent does not send it";
    EXPECT_EQ(rig.dropped(DropReason::wrong_way), 0u);
    EXPECT_EQ(rig.dropped(DropReason::no_subscriber), 1u);
    EXPECT_EQ(rig.dropped(DropReason::not_allowed), 2u) << "of another hub's node, and of the node";
    EXPECT_THAT(parent.reports(), IsEmpty());
    EXPECT_TRUE(rig.ledger().exact());
    static_cast<void>(rig.groups().exchange_away(make_id<GroupId>(kFar, 5), nullptr));
  }
}

TEST(LinkReader, ABroadcastGoesOnAlongTheShortestWaysOnce) {
  constexpr std::uint32_t kAll = make_id<NodeId>(kEveryHub, kEveryIndex).value();
  for (const std::size_t shard : {0u, 1u}) {
    HubRig rig(2);
    FakeNode& node = rig.join(0);
    FakeNode& near = rig.link(0, kNear);
    FakeNode& far = rig.link(shard, kFar);
    FakeNode& spare = rig.link(1, HubId{40});
    // The way to hub 40 is over another link: it hears from there.
    rig.routes().publish(HubId{40}, rig.routes().find(kFar));
    rig.routes().publish_shards(3);
    rig.write(near, frame_after(0, kAll, "all", {.kind = Kind::broadcast}));
    rig.write(far, frame_after(3, kAll, "all", {.kind = Kind::broadcast}));
    rig.settle();
    EXPECT_THAT(node.texts(), ElementsAre("all"));
    EXPECT_THAT(far.texts(), ElementsAre("all"));
    EXPECT_THAT(near.texts(), IsEmpty()) << "it came from there";
    EXPECT_THAT(spare.texts(), IsEmpty());
    EXPECT_EQ(rig.dropped(DropReason::wrong_way), 1u);
    rig.send(node, kAll, "mine", {.kind = Kind::broadcast});
    rig.settle();
    EXPECT_THAT(near.texts(), ElementsAre("mine"));
    EXPECT_THAT(far.texts(), ElementsAre("all", "mine"));
    EXPECT_TRUE(rig.ledger().exact());
  }
}

TEST(LinkReader, ABroadcastToOneHubIsRouted) {
  HubRig rig;
  FakeNode& node = rig.join(0);
  FakeNode& near = rig.link(0, kNear);
  FakeNode& far = rig.link(0, kFar);
  rig.routes().publish_shards(1);
  const FrameSpec spec{.kind = Kind::broadcast};
  rig.write(near, frame_after(0, make_id<NodeId>(kFar, kEveryIndex).value(), "there", spec));
  rig.write(near, frame_after(0, make_id<NodeId>(HubId{7}, kEveryIndex).value(), "here", spec));
  rig.settle();
  EXPECT_THAT(far.texts(), ElementsAre("there"));
  EXPECT_THAT(node.texts(), ElementsAre("here"));
}

TEST(LinkReader, WhatALinkDidNotConfirmIsUnsure) {
  HubRig rig;
  FakeNode& node = rig.join(0);
  FakeNode& link = rig.link(0, kNear, {.resume = true});
  rig.send(node, kSource, "written", {.flags = proto::kFlagReport});
  rig.settle();
  ASSERT_THAT(link.texts(), ElementsAre("written"));
  link.pipe.close();
  rig.settle();
  rig.send(node, kSource, "waits", {.flags = proto::kFlagReport});
  rig.settle();
  EXPECT_EQ(rig.ledger().queued, 2u) << "the link may come back";
  rig.release(link);
  rig.settle();
  EXPECT_EQ(rig.dropped(DropReason::link_unsure), 1u);
  EXPECT_EQ(rig.dropped(DropReason::link_lost), 1u);
  EXPECT_TRUE(rig.ledger().exact());
}

}  // namespace
}  // namespace gimnet::hub
