#include "hub/control/remote_requests.hpp"

#include <gtest/gtest.h>

#include "proto/control/ctrl.hpp"
#include "tests/hub/control/support/link_rig.hpp"

namespace gimnet::hub {
namespace {

using proto::Kind;
using std::chrono::milliseconds;

constexpr NodeId kAsker = make_id<NodeId>(HubId{1}, 5);

/// Requests of a node of hub 1 to hub 2, and of a node of hub 2 to hub 1.
struct Rig : LinkedRigs {
  Rig() {
    link();
    static_cast<void>(a.take_frames());
  }
  ControlFrameEvent request(HubId to, std::uint16_t number) const {
    ControlFrameEvent event{{ConnectionSlot{3}, 33}, 4, kAsker, {}};
    event.frame = control_frame(Kind::ctrl, make_id<NodeId>(to, kHubIndex), HubId{1},
                                proto::encode(proto::ctrl::HubInfo{}, number));
    proto::FrameHeader header = proto::load_header(event.frame.data());
    header.src = kAsker.value();
    proto::store_header(event.frame.data(), header);
    return event;
  }
  ControlFrameEvent from_link(Kind kind, NodeId to, std::span<const std::byte> payload) const {
    ControlFrameEvent event{{}, 1, make_id<NodeId>(HubId{2}, kHubIndex), {}};
    event.frame = control_frame(kind, to, HubId{2}, payload);
    return event;
  }
  RemoteRequests requests{{a.facts, a.shards, a.links}};
};

TEST(RemoteRequests, AnAnswerGoesToWhoAskedAndOnce) {
  Rig rig;
  EXPECT_FALSE(rig.requests.send_on(rig.request(HubId{2}, 9), ShardIndex{0}, rig.a.now));
  const auto sent = rig.a.take_frames();
  ASSERT_EQ(sent.size(), 1u);
  EXPECT_EQ(proto::load_header(sent[0].frame.data()).dst, make_id<NodeId>(HubId{2}, 0).value());
  const auto answer = proto::encode_answer(proto::ctrl::HubInfoAnswer{}, 9);
  for (int i = 0; i < 2; ++i)
    EXPECT_FALSE(rig.requests.take(rig.from_link(Kind::ctrl, kAsker, answer), rig.a.now));
  const auto told = rig.a.take_frames();
  ASSERT_EQ(told.size(), 1u);
  EXPECT_EQ(told[0].session.generation, 33u);
  EXPECT_EQ(told[0].attachment, 4u);
  EXPECT_EQ(told[0].answers, 1u);
}

TEST(RemoteRequests, ASilentHubIsAnsweredFor) {
  Rig rig;
  EXPECT_FALSE(rig.requests.send_on(rig.request(HubId{2}, 9), ShardIndex{0}, rig.a.now));
  static_cast<void>(rig.a.take_frames());
  rig.requests.tick(rig.a.now + RemoteRequests::kAnswerTime - milliseconds{1});
  EXPECT_TRUE(rig.a.take_frames().empty());
  rig.requests.tick(*rig.requests.next_due());
  const auto told = rig.a.take_frames();
  ASSERT_EQ(told.size(), 1u);
  EXPECT_EQ(proto::peek_status(std::span{told[0].frame}.subspan(proto::kHeaderSize)),
            proto::Status::not_found);
  EXPECT_FALSE(rig.requests.next_due());
}

TEST(RemoteRequests, WithoutARouteTheRefusalSaysSo) {
  Rig rig;
  const auto refusal = rig.requests.send_on(rig.request(HubId{3}, 9), ShardIndex{0}, rig.a.now);
  ASSERT_TRUE(refusal);
  EXPECT_EQ(refusal->status, proto::Status::not_found);
  EXPECT_NE(refusal->sentence.find("hub 3"), std::string::npos);
}

TEST(RemoteRequests, WhereNoAnswerMayComeTheRefusalSaysSo) {
  LinksOptions options = LinkRig::dialling();
  options.dial[0].terms.allow = {HubId{9}};
  LinkedRigs hubs(options);
  hubs.link();
  RemoteRequests requests({hubs.b.facts, hubs.b.shards, hubs.b.links});
  const auto refusal = requests.send_on(Rig().request(HubId{1}, 9), ShardIndex{0}, hubs.b.now);
  ASSERT_TRUE(refusal);
  EXPECT_EQ(refusal->status, proto::Status::denied);
  EXPECT_NE(refusal->sentence.find("`allow`"), std::string::npos);
  EXPECT_FALSE(requests.next_due());
}

TEST(RemoteRequests, AFloodFromOneLinkIsAnsweredRate) {
  Rig rig;
  const auto ask = proto::encode(proto::ctrl::HubInfo{}, 1);
  const auto event = rig.from_link(Kind::ctrl, make_id<NodeId>(HubId{1}, kHubIndex), ask);
  std::uint64_t taken = 0;
  while (rig.requests.take(event, rig.a.now)) ++taken;
  EXPECT_EQ(taken, RemoteRequests::kRate.burst);
  const auto told = rig.a.take_frames();
  ASSERT_EQ(told.size(), 1u);
  EXPECT_EQ(proto::peek_status(std::span{told[0].frame}.subspan(proto::kHeaderSize)),
            proto::Status::rate);
}

TEST(RemoteRequests, NothingGoesBackToWhereItCameFrom) {
  Rig rig;
  const auto ask = proto::encode(proto::ctrl::HubInfo{}, 1);
  EXPECT_FALSE(rig.requests.take(
      rig.from_link(Kind::ctrl, make_id<NodeId>(HubId{2}, kHubIndex), ask), rig.a.now));
  EXPECT_TRUE(rig.a.take_frames().empty());
}

}  // namespace
}  // namespace gimnet::hub
