#include "hub/control/moving_nodes.hpp"

#include <gtest/gtest.h>

#include "base/endian.hpp"
#include "hub/control/remote_requests.hpp"
#include "proto/control/ns_register.hpp"
#include "tests/hub/control/support/link_rig.hpp"

namespace gimnet::hub {
namespace {

using std::chrono::milliseconds;

/// A node of hub 2 that says HELLO at hub 1.
struct MovingRig : LinkedRigs {
  MovingRig() {
    link();
    static_cast<void>(a.take_frames());
  }
  bool take(HubId from, std::uint32_t token_bytes = 8) {
    Stranger stranger;
    stranger.transport = std::make_unique<NoStream>();
    stranger.identity = Identity::of_user(9);
    proto::Hello hello;
    hello.name = "robot";
    hello.token.resize(token_bytes);
    hello.former = make_id<NodeId>(from, 3);
    return moving.take(stranger, hello, a.now);
  }
  /// Gives the number of those that are admitted then.
  std::size_t settle(std::span<const HubAnswer> answers) {
    std::size_t admitted = 0;
    moving.settle(answers, a.now, [&](Stranger&, const proto::Hello&, bool had_name) {
      ++admitted;
      admitted_with_name += had_name ? 1 : 0;
      return std::optional<proto::Goodbye>{};
    });
    return admitted;
  }
  /// Node 2.3 has the name "robot", as hub 2 says.
  void learn_name() {
    proto::route::NameClaim claim;
    claim.version = 1;
    claim.node = make_id<NodeId>(HubId{2}, 3);
    const auto names =
        proto::encode(proto::route::Names{HubId{2}, b.facts.instance, 0, 1, 0, {{"robot", claim}}});
    a.names.take(a.links.all().begin()->first, names, a.now);
  }
  std::size_t admitted_with_name = 0;
  RemoteRequests requests{{a.facts, a.shards, a.links}};
  MovingNodes moving{{a.facts, a.limits, a.links, a.names}};
};

TEST(MovingNodes, AreAdmittedWhenTheirFormerHubHasAnswered) {
  MovingRig rig;
  ASSERT_TRUE(rig.take(HubId{2}));
  const auto asked = rig.a.take_frames();
  ASSERT_EQ(asked.size(), 1u);
  const std::span payload = std::span{asked[0].frame}.subspan(proto::kHeaderSize);
  const auto let_go = proto::decode<proto::ns::LetGo>(payload);
  ASSERT_TRUE(let_go);
  EXPECT_EQ(let_go->name, "robot");
  EXPECT_EQ(let_go->user, 9u);
  EXPECT_EQ(rig.settle({}), 0u);
  const auto answer =
      proto::encode_answer(proto::ns::LetGoAnswer{}, proto::split_control(payload)->header.request);
  ControlFrameEvent event{{}, 1, make_id<NodeId>(HubId{2}, kHubIndex), {}};
  event.frame =
      control_frame(proto::Kind::ns, make_id<NodeId>(HubId{1}, kHubIndex), HubId{2}, answer);
  auto forged = event;
  store_le(forged.frame.data() + proto::kSrcOffset, make_id<NodeId>(HubId{2}, 7).value());
  EXPECT_FALSE(rig.requests.take(forged, rig.a.now));
  EXPECT_TRUE(rig.requests.take_own_answers().empty()) << "a node answers for no hub";
  EXPECT_FALSE(rig.requests.take(event, rig.a.now));
  EXPECT_EQ(rig.settle(rig.requests.take_own_answers()), 1u);
  EXPECT_FALSE(rig.moving.next_due());
}

TEST(MovingNodes, HadTheNameThatTheirFormerHubLetGoOf) {
  MovingRig rig;
  const auto answer = [](std::uint16_t request, proto::Status status) {
    return std::vector<HubAnswer>{{HubId{2}, request, status}};
  };
  ASSERT_TRUE(rig.take(HubId{2}));
  EXPECT_EQ(rig.settle(answer(1, proto::Status::done)), 1u);
  EXPECT_EQ(rig.admitted_with_name, 0u) << "nobody was known to have it";
  rig.learn_name();
  ASSERT_TRUE(rig.take(HubId{2}));
  EXPECT_EQ(rig.settle(answer(2, proto::Status::not_found)), 1u);
  EXPECT_EQ(rig.admitted_with_name, 0u) << "the token did not count";
  ASSERT_TRUE(rig.take(HubId{2}));
  EXPECT_EQ(rig.settle(answer(3, proto::Status::done)), 1u);
  EXPECT_EQ(rig.admitted_with_name, 1u);
}

TEST(MovingNodes, DoNotWaitForAHubThatIsSilentOrAway) {
  MovingRig rig;
  ASSERT_TRUE(rig.take(HubId{2}));
  rig.a.now = *rig.moving.next_due() - milliseconds{1};
  EXPECT_EQ(rig.settle({}), 0u);
  rig.a.now += milliseconds{1};
  EXPECT_EQ(rig.settle({}), 1u);
  ASSERT_TRUE(rig.take(HubId{2}));
  rig.a.detach(rig.a.attached(), proto::GoodbyeCode::draining, true);
  EXPECT_EQ(rig.settle({}), 1u) << "there is no way to it any more";
}

TEST(MovingNodes, OthersAreNotTaken) {
  MovingRig rig;
  EXPECT_FALSE(rig.take(HubId{1})) << "the token is of this hub";
  EXPECT_FALSE(rig.take(HubId{3})) << "there is no way";
  EXPECT_FALSE(rig.take(HubId{2}, 0)) << "it has no token";
  rig.a.limits.handshakes = 1;
  EXPECT_TRUE(rig.take(HubId{2}));
  EXPECT_FALSE(rig.take(HubId{2})) << "as many wait as may";
}

}  // namespace
}  // namespace gimnet::hub
