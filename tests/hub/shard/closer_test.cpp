#include "hub/shard/closer.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "tests/hub/shard/support/hub_rig.hpp"

namespace gimnet::hub {
namespace {

using proto::DropReason;
using proto::GoodbyeCode;
using ::testing::ElementsAre;
using testing::FakeNode;
using testing::HubRig;
using ::testing::IsEmpty;

TEST(Closer, SaysGoodbyeAndTellsTheConductor) {
  HubRig rig;
  FakeNode& a = rig.join(0);
  rig.command(0, CloseCommand{a.session, GoodbyeCode::kicked, "an administrator wants it"});
  rig.settle();
  ASSERT_TRUE(a.goodbye);
  EXPECT_EQ(a.goodbye->code, GoodbyeCode::kicked);
  EXPECT_EQ(a.goodbye->sentence, "an administrator wants it");
  EXPECT_TRUE(a.pipe.transport_gone());
  const auto detached = rig.take_detached();
  ASSERT_TRUE(detached);
  EXPECT_EQ(detached->node, a.id);
  EXPECT_EQ(detached->attachment, 1u);
  EXPECT_EQ(detached->code, GoodbyeCode::kicked);
}

TEST(Closer, CountsWhoAskedForTooMuchAndWhoFoundNoMemory) {
  HubRig rig;
  rig.command(0, CloseCommand{rig.join(0).session, GoodbyeCode::too_many_requests, "slower"});
  rig.command(0, CloseCommand{rig.join(0).session, GoodbyeCode::no_memory, "later"});
  rig.command(0, CloseCommand{rig.join(0).session, GoodbyeCode::kicked, "go"});
  rig.settle();
  EXPECT_EQ(rig.sum(&ShardCounters::too_many_requests), 1u);
  EXPECT_EQ(rig.sum(&ShardCounters::no_memory), 1u);
}

TEST(Closer, CountsWhomTheConductorCannotRead) {
  HubRig rig;
  rig.command(0, CloseCommand{rig.join(0).session, GoodbyeCode::malformed, "no request number"});
  rig.settle();
  EXPECT_EQ(rig.sum(&ShardCounters::malformed), 1u);
  EXPECT_EQ(rig.dropped(DropReason::malformed), 0u) << "control frames are none of the ledger's";
}

TEST(Closer, CountsWhoEndsInTheMiddleOfAFrame) {
  HubRig rig;
  std::uint64_t ended = 0;
  for (const std::size_t size :
       {std::size_t{1}, proto::kHeaderSize - 1, proto::kHeaderSize, std::size_t{4'000}}) {
    for (const bool reset : {false, true}) {
      FakeNode& a = rig.join(0);
      const auto frame = HubRig::frame(a, a.id.value(), std::string(5'000, 'x'));
      rig.write(a, std::span(frame).first(size));
      rig.turn();
      reset ? a.pipe.reset() : a.pipe.close();
      rig.settle_without_reading();
      EXPECT_TRUE(a.pipe.transport_gone());
      EXPECT_EQ(rig.sum(&ShardCounters::unfinished_frames), ++ended) << size << " bytes";
    }
  }
}

TEST(Closer, WhoEndsBetweenTwoFramesIsNotCounted) {
  HubRig rig;
  FakeNode& a = rig.join(0);
  const auto frame = HubRig::frame(a, a.id.value(), "whole");
  rig.write(a, std::span(frame).first(5));
  rig.turn();
  rig.write(a, std::span(frame).subspan(5));
  a.pipe.close();
  rig.settle();
  EXPECT_TRUE(a.pipe.transport_gone());
  EXPECT_EQ(rig.sum(&ShardCounters::unfinished_frames), 0u);
}

TEST(Closer, ClosingTwiceTellsOnce) {
  HubRig rig;
  FakeNode& a = rig.join(0);
  rig.command(0, CloseCommand{a.session, GoodbyeCode::kicked, "first"});
  rig.command(0, CloseCommand{a.session, GoodbyeCode::silent, "second"});
  rig.settle();
  EXPECT_EQ(rig.take_events().size(), 1u);
  EXPECT_EQ(rig.sum(&ShardCounters::connections), 0u);
}

// In the middle of a frame a GOODBYE would be read as the rest of it.
TEST(Closer, SaysNothingInTheMiddleOfAFrame) {
  HubRig rig;
  FakeNode& a = rig.join(0);
  FakeNode& b = rig.join(0);
  b.pipe.set_room(10);
  rig.send(a, b.id.value(), "a frame of which ten bytes are written");
  rig.settle_without_reading();
  b.pipe.set_room(MemoryPeer::kAll);
  rig.command(0, CloseCommand{b.session, GoodbyeCode::kicked, "kicked"});
  rig.turn();
  std::vector<std::byte> bytes;
  EXPECT_EQ(b.pipe.read(bytes), 10u);
  EXPECT_EQ(rig.dropped(DropReason::link_lost), 1u);
}

TEST(Closer, ForgetsABegunFrame) {
  Limits limits;
  limits.partial_bytes = 1 << 20;
  HubRig rig(1, limits);
  // More often than there is room for at once.
  for (int i = 0; i < 10; ++i) {
    FakeNode& a = rig.join(0);
    const auto frame = HubRig::frame(a, a.id.value(), std::string(5'000, 'x'));
    rig.write(a, std::span(frame).first(4'000));
    rig.turn();
    EXPECT_FALSE(a.pipe.transport_gone());
    a.pipe.close();
    rig.settle();
    EXPECT_TRUE(a.pipe.transport_gone());
  }
  EXPECT_EQ(rig.ledger().accepted, 0u) << "nothing partial counts";
}

TEST(Closer, AReleasedSessionTakesEverythingWithIt) {
  HubRig rig;
  FakeNode& a = rig.join(0);
  FakeNode& b = rig.join(0, {.resume = true});
  rig.send(a, b.id.value(), "written, not confirmed");
  rig.settle();
  b.pipe.set_room(0);
  rig.send(a, b.id.value(), "waits");
  rig.settle_without_reading();
  EXPECT_EQ(rig.ledger().queued, 2u);
  rig.release(b);
  rig.settle();
  EXPECT_EQ(rig.ledger().queued, 0u);
  EXPECT_EQ(rig.dropped(DropReason::link_unsure), 1u) << "its program may have taken it";
  EXPECT_EQ(rig.dropped(DropReason::link_lost), 1u);
  EXPECT_EQ(rig.sum(&ShardCounters::sessions), 1u);
  EXPECT_THAT(rig.take_events(), IsEmpty()) << "the conductor asked for it";
  rig.send(a, b.id.value(), "nobody");
  rig.settle();
  EXPECT_EQ(rig.dropped(DropReason::no_such_node), 1u);
}

TEST(Closer, TellsWhatTheSessionOfALinkCameTo) {
  HubRig rig;
  FakeNode& a = rig.join(0);
  FakeNode& link = rig.link(0, HubId{9}, {.resume = true});
  rig.send(link, a.id.value(), "from it", {.src = make_id<NodeId>(HubId{9}, 5).value()});
  for (int i = 0; i < 3; ++i) rig.send(a, make_id<NodeId>(HubId{9}, 5).value(), "for it");
  rig.settle();
  rig.send_flow(link, proto::flow::Confirm{1});
  rig.settle();
  rig.release(link);
  rig.settle();
  const auto events = rig.take_events();
  ASSERT_EQ(events.size(), 1u);
  const auto* released = std::get_if<ReleasedEvent>(&events[0].what);
  ASSERT_NE(released, nullptr);
  EXPECT_EQ(released->session.generation, link.session.generation);
  EXPECT_EQ(released->counts.accepted, 1u);
  EXPECT_EQ(released->counts.delivered, 1u);
  EXPECT_EQ(released->counts.dropped, 2u);
  EXPECT_EQ(released->counts.unsure, 2u) << "written, and not confirmed";
}

TEST(Closer, TellsSendersWhatAResumeBufferLost) {
  for (const bool comes_back_anew : {false, true}) {
    HubRig rig;
    FakeNode& a = rig.join(0);
    FakeNode& b = rig.join(0, {.resume = true});
    for (int i = 0; i < 3; ++i)
      rig.send(a, b.id.value(), "written, not confirmed", {.flags = proto::kFlagReport});
    rig.settle();
    if (comes_back_anew) {
      rig.rejoin(b, {.resume = true, .epoch = 78});  // another life, which took nothing
    } else {
      rig.release(b);
    }
    rig.pass_ms(1'000);
    rig.settle();
    EXPECT_EQ(rig.dropped(DropReason::link_unsure), 3u);
    std::uint64_t told = 0;
    for (const auto& report : a.reports()) {
      EXPECT_EQ(report.reason, DropReason::link_unsure);
      told += report.count;
    }
    EXPECT_EQ(told, 3u) << comes_back_anew;
  }
}

// The shard finds the messages that it kept for a provider by the id that the provider has now, not
// by the one under which it sent them.
TEST(Closer, ARenumberedProvidersLastMessagesGoWithIt) {
  HubRig rig;
  FakeNode& provider = rig.join(0, {.resume = true});
  rig.publish_paced_group(5, provider.id, {}, true);
  rig.send(provider, HubRig::group(5), std::string(5'000, 'L'), {.kind = proto::Kind::group});
  rig.settle();
  ASSERT_EQ(rig.state(0).retained.groups(), 1u);
  rig.renumber(provider, 400);
  rig.settle();
  rig.withdraw_group(5);
  rig.release(provider);
  rig.settle();
  EXPECT_EQ(rig.state(0).retained.groups(), 0u);
  EXPECT_EQ(rig.state(0).pool.pinned_bytes(), 0u);
}

// The slot goes to another session; a frame that waited or still comes for the old one is not for
// it.
TEST(Closer, ASlotIsReusedWithoutItsPast) {
  HubRig rig(2);
  FakeNode& a = rig.join(1);
  FakeNode& old = rig.join(0);
  const NodePlace place{old.shard, old.session.slot, old.session.generation};
  rig.turn();
  rig.release(old);
  rig.turn();
  FakeNode& next = rig.join(0);
  AttachCommand command;
  auto [transport, peer] = make_memory_pipe();
  command.session = {old.session.slot, old.session.generation + 1};
  command.attachment = 1;
  command.node = make_id<NodeId>(rig.hub(), 500);
  command.transport = std::move(transport);
  command.peer_frame_bytes = 65'536;
  rig.command(0, std::move(command));
  rig.turn();
  // The table still says that the old node lives in that slot.
  rig.nodes().publish(index_of(old.id), place);
  const std::size_t before = peer.readable();
  rig.send(a, old.id.value(), "for the old one");
  rig.send(a, next.id.value(), "for the next one");
  rig.settle();
  EXPECT_EQ(peer.readable(), before);
  EXPECT_THAT(next.texts(), ElementsAre("for the next one"));
  EXPECT_EQ(rig.dropped(DropReason::no_such_node), 1u);
}

// The table may name it a little longer.
TEST(Closer, NothingIsSentToASessionThatIsOver) {
  HubRig rig;
  FakeNode& a = rig.join(0);
  FakeNode& b = rig.join(0);
  for (int i = 0; i < 2; ++i) {
    rig.send(a, b.id.value(), "x");
    rig.settle();
  }
  rig.command(0, ReleaseCommand{b.session});
  rig.settle();
  rig.send(a, b.id.value(), "x", {.flags = static_cast<std::uint8_t>(proto::Policy::drop)});
  rig.send(a, b.id.value(), "x");
  rig.settle();
  EXPECT_EQ(rig.dropped(DropReason::no_such_node), 2u);
  EXPECT_TRUE(rig.ledger().exact());
}

TEST(Closer, DeliversNothingOfAFrameThatIsCutAnywhere) {
  for (const bool broken : {false, true}) {
    for (std::size_t cut = 0; cut < proto::kHeaderSize + 8; ++cut) {
      SCOPED_TRACE(cut);
      HubRig rig;
      FakeNode& a = rig.join(0);
      FakeNode& b = rig.join(0);
      std::vector<std::byte> bytes = HubRig::frame(a, b.id.value(), "whole");
      const std::vector<std::byte> half = HubRig::frame(a, b.id.value(), "8 bytes.");
      bytes.insert(bytes.end(), half.begin(), half.begin() + static_cast<std::ptrdiff_t>(cut));
      rig.write(a, bytes);
      rig.settle();
      if (broken) {
        a.pipe.reset();
      } else {
        a.pipe.close();
      }
      rig.settle();
      EXPECT_THAT(b.texts(), ElementsAre("whole"));
      EXPECT_EQ(rig.ledger().accepted, 1u) << "what never was a frame is not counted as one";
      EXPECT_TRUE(rig.ledger().exact());
      EXPECT_TRUE(a.pipe.transport_gone());
    }
  }
}

TEST(Closer, LooksAtNothingBehindAGoodbye) {
  HubRig rig;
  FakeNode& a = rig.join(0);
  FakeNode& b = rig.join(0);
  std::vector<std::byte> bytes = HubRig::frame(a, b.id.value(), "before");
  const auto add = [&bytes](const std::vector<std::byte>& frame) {
    bytes.insert(bytes.end(), frame.begin(), frame.end());
  };
  const auto payload = proto::encode(proto::Goodbye{GoodbyeCode::done, ""});
  add(HubRig::frame(a, 0,
                    std::string(reinterpret_cast<const char*>(payload.data()), payload.size()),
                    {.kind = proto::Kind::link}));
  for (int i = 0; i < 1'000; ++i) add(HubRig::frame(a, b.id.value(), "behind"));
  rig.write(a, bytes);
  rig.settle();
  EXPECT_THAT(b.texts(), ElementsAre("before"));
  EXPECT_EQ(rig.ledger().accepted, 1u);
}

}  // namespace
}  // namespace gimnet::hub
