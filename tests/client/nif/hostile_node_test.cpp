// Frames of another node, which the hub only passes on: they cost their reader nothing.

#include <gtest/gtest.h>

#include <string>
#include <vector>

#include "client/nif/inbound.hpp"
#include "tests/client/nif/support/fake_hub.hpp"
#include "tests/client/nif/support/recording_host.hpp"

namespace gimnet::nif::test {
namespace {

proto::FrameParts from_peer(proto::Kind kind = proto::Kind::unicast) {
  proto::FrameParts parts;
  parts.header.kind = kind;
  parts.header.src = kPeerId;
  parts.header.dst = kOwnId;
  return parts;
}

TEST(HostileNode, SendsFramesThatAreDroppedAndCounted) {
  proto::FrameHeader lane;
  lane.lane = 4;
  proto::FrameHeader extensions;
  extensions.flags = proto::kFlagExt;
  proto::FrameHeader fragment;
  fragment.flags = proto::kFlagFragment;
  proto::FrameHeader key;
  key.flags = proto::kFlagKeyed;
  proto::FrameHeader list;
  list.kind = proto::Kind::list;
  list.dst = 1;
  list.length = 3;
  proto::FrameHeader taken;
  taken.kind = proto::Kind::taken;
  taken.length = proto::kTakenSize - 1;
  for (proto::FrameHeader header : {lane, extensions, fragment, key, list, taken}) {
    Receiving receiving;
    header.src = kPeerId;
    if (header.kind != proto::Kind::list) header.dst = kOwnId;
    std::vector<std::byte> bytes(header.frame_size());
    proto::store_header(bytes.data(), header);
    add_frame(bytes, from_peer(), "behind it");
    EXPECT_EQ(receiving.feed(bytes), Inbound::Verdict::going);
    EXPECT_EQ(receiving.host.texts(), std::vector<std::string>{"behind it"});
    EXPECT_TRUE(receiving.host.taken_received.empty());
    EXPECT_EQ(receiving.inbound.counts().unreadable, 1u);
    EXPECT_EQ(receiving.inbound.counts().frames, 2u);
    EXPECT_EQ(receiving.inbound.taken(), 2u) << "the hub counts it for resume";
  }
}

// 16 connections with 16 streams each would take the place of everybody's unfinished messages.
TEST(HostileNode, LosesItsOwnUnfinishedMessagesWhereThereAreTooMany) {
  Receiving receiving;
  std::vector<std::byte> bytes;
  proto::FrameParts first = from_peer();
  first.fragment = proto::FragmentHeader{1, 0, 6};
  add_frame(bytes, first, "abc");
  const std::uint32_t streams = proto::ReassemblyLimits{}.streams_max;
  for (std::uint32_t i = 0; i < streams + 100; ++i) {
    proto::FrameParts parts = from_peer(proto::Kind::group);
    parts.header.src = kPeerId + 1 + i % 16;
    parts.header.dst = 1 + i;
    parts.fragment = proto::FragmentHeader{1 + i, 0, 6};
    add_frame(bytes, parts, "abc");
  }
  first.fragment->offset = 3;
  add_frame(bytes, first, "def");
  ASSERT_EQ(receiving.feed(bytes), Inbound::Verdict::going);
  EXPECT_EQ(receiving.host.texts(), std::vector<std::string>{"abcdef"});
  EXPECT_EQ(receiving.inbound.counts().messages_lost, 101u);
  EXPECT_EQ(receiving.host.gaps(), 101u);
  for (const auto& item : receiving.host.items) {
    EXPECT_FALSE(item.type == NIF_GAP && item.from == kPeerId) << "it names the loser";
  }
}

// A node that does not read must not make its hub stop reading the one that answers it.
TEST(HostileNode, IsToldNothingWhileTheHubHasPausedTheWay) {
  FakeHub hub;
  Connected connected = connect_to(hub, default_options(), make_welcome());
  const proto::flow::Target way{proto::Kind::taken, proto::Lane::real_time, kPeerId};
  const auto refused = [&](std::uint32_t number) {
    proto::FrameParts parts = from_peer();
    parts.fragment = proto::FragmentHeader{number, 0, NIF_MESSAGE_BYTES_MAX};
    connected.hub.send(parts, "x");
  };
  const auto next_taken = [&] {
    return proto::decode_taken(connected.hub.next_message()->view().payload);
  };
  refused(1);
  EXPECT_EQ(next_taken(), proto::ReceiveWindow::refusal(1));
  connected.hub.send(proto::flow::Pause{way});
  refused(2);
  refused(3);
  connected.hub.send(proto::flow::Ping{1, 2});
  const auto answer = connected.hub.next();
  ASSERT_TRUE(answer);
  EXPECT_EQ(answer->header.kind, proto::Kind::flow) << "the PONG, and no TAKEN before it";
  connected.hub.send(proto::flow::Resume{way});
  EXPECT_EQ(next_taken(), proto::ReceiveWindow::refusal(3));
}

TEST(HostileNode, PaysForTheBytesThatItsMessagesKeep) {
  constexpr std::size_t kRounds = 40;
  Receiving receiving;
  const std::string waste(60'000, 'x');
  std::vector<std::byte> round;
  add_frame(round, from_peer(), "m");
  for (int i = 0; i < 9; ++i)  // two slabs
    add_frame(round, from_peer(static_cast<proto::Kind>(9)), waste);
  for (std::size_t i = 0; i < kRounds; ++i)
    ASSERT_EQ(receiving.feed(round), Inbound::Verdict::going);
  EXPECT_EQ(receiving.host.texts().size(), kRounds);
  // Each message keeps a slab; the last one has not paid for the bytes behind it.
  EXPECT_GE(receiving.host.item_bytes,
            (kRounds - 1) * (Slab::kBytes - 2 * proto::kHeaderSize - waste.size()));
  receiving.host.item_bytes = 0;
  std::vector<std::byte> small;
  for (int i = 0; i < 100; ++i) add_frame(small, from_peer(), "m");
  ASSERT_EQ(receiving.feed(small), Inbound::Verdict::going);
  EXPECT_LE(receiving.host.item_bytes, 2 * Slab::kBytes + small.size());
  receiving.host.item_bytes = 0;
  ASSERT_EQ(receiving.feed(small), Inbound::Verdict::going);
  EXPECT_EQ(receiving.host.item_bytes, small.size());
}

}  // namespace
}  // namespace gimnet::nif::test
