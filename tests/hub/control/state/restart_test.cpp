#include <gtest/gtest.h>

#include <algorithm>
#include <memory>
#include <utility>

#include "hub/control/state/membership.hpp"

// Tests the promises of the state machines to nodes that come back to a hub which was killed.

namespace gimnet::hub {
namespace {

using namespace std::chrono_literals;
using proto::GoodbyeCode;

/// A hub that was killed, and starts again with what it had kept.
class RestartTest : public ::testing::Test {
 protected:
  using Node = std::pair<NodeIndex, std::vector<std::byte>>;  ///< index, token

  std::unique_ptr<Membership> start(std::uint32_t mark, std::uint64_t boot) {
    Durable kept;
    kept.nodes.mark = kept.groups.mark = mark;
    return start(kept, boot);
  }
  /// Goes on from what was kept.
  std::unique_ptr<Membership> start(const Durable& kept, std::uint64_t boot) {
    Sessions::Options options;
    options.hub = HubId{7};
    options.boot = boot;
    options.nodes = {kept.nodes.mark, IndexPool::kBlock, kept.nodes.used};
    options.groups = {kept.groups.mark, IndexPool::kBlock};
    options.kicked = kept.kicked;
    if (boot > 1) options.returns_until = std::chrono::milliseconds{limits_.grace_ms};
    return std::make_unique<Membership>(options, limits_);
  }
  static Node join(Membership& hub, const std::string& name,
                   std::span<const std::byte> token = {}) {
    JoinRequest request;
    request.name = name;
    request.identity = Identity::open();
    request.token = token;
    Effects effects;
    const auto joined = hub.join(request, 0ms, effects);
    EXPECT_TRUE(joined);
    if (!joined) return {};
    return {joined->session->index, hub.sessions().token_of(*joined->session)};
  }

  Limits limits_;
};

TEST_F(RestartTest, NodesComeBackUnderTheirIdsAndNewcomersGetOthers) {
  const auto before = start(1, 1);
  const Node j = join(*before, "J");
  const Node k = join(*before, "K");
  const auto after = start(before->durable(0ms), 2);
  const Node z = join(*after, "Z");
  EXPECT_NE(z.first, j.first);
  EXPECT_NE(z.first, k.first);
  EXPECT_EQ(join(*after, "K", k.second).first, k.first);
  EXPECT_EQ(after->directory().find("K"), k.first);
  EXPECT_TRUE(after->sessions().find(k.first)->came_back);
}

TEST_F(RestartTest, AnIdThatSomebodyElseHoldsIsNotGivenBack) {
  const auto before = start(1, 1);
  const Node old = join(*before, "old");
  const auto after = start(1, 2);  // as if the mark had come round
  ASSERT_EQ(join(*after, "Z").first, old.first);
  EXPECT_NE(join(*after, "old", old.second).first, old.first);
}

TEST_F(RestartTest, ATokenOfAnEarlierHolderDoesNotClaimAnIdThatWasGivenOn) {
  const auto before = start(1, 1);
  const Node old = join(*before, "old");
  const auto after = start(1, 2);
  Effects effects;
  ASSERT_EQ(join(*after, "Z").first, old.first);
  after->connection_ended(*after->sessions().find(old.first), {false, GoodbyeCode::silent, ""}, 0ms,
                          effects);
  after->tick(std::chrono::milliseconds{limits_.grace_ms}, effects);
  ASSERT_EQ(after->sessions().find(old.first), nullptr);
  EXPECT_NE(join(*after, "old", old.second).first, old.first);
}

TEST_F(RestartTest, AKickedNodeStaysKicked) {
  const auto before = start(1, 1);
  const Node bad = join(*before, "bad");
  Effects effects;
  before->kick(*before->sessions().find(bad.first), "why", 0ms, effects);
  const auto after = start(before->durable(0ms), 2);
  EXPECT_NE(join(*after, "bad", bad.second).first, bad.first);
}

TEST_F(RestartTest, NoIdIsGivenAwayThatANodeMayComeBackUnder) {
  const auto before = start(1, 1);
  const Node absent = join(*before, "absent");
  const auto after = start(before->durable(0ms), 2);
  Session& other = *after->sessions().find(join(*after, "other").first);
  Effects effects;
  const std::chrono::milliseconds over{limits_.grace_ms};
  const auto refused = after->renumber(other, absent.first, over - 1ms, effects);
  ASSERT_TRUE(refused);
  EXPECT_EQ(refused->status, proto::Status::taken);
  EXPECT_NE(refused->sentence.find("has not come back yet; try again in 1 s"), std::string::npos)
      << refused->sentence;
  EXPECT_TRUE(effects.empty());
  EXPECT_EQ(join(*after, "absent", absent.second).first, absent.first);
  const auto held = after->renumber(other, absent.first, over - 1ms, effects);
  ASSERT_TRUE(held);
  EXPECT_NE(held->sentence.find("another node 'absent'"), std::string::npos) << held->sentence;
  Session& third = *after->sessions().find(join(*after, "third").first);
  EXPECT_FALSE(after->renumber(third, NodeIndex{500'000}, over - 1ms, effects)) << "nobody had it";
  EXPECT_FALSE(after->renumber(other, NodeIndex{absent.first.value() + 1}, over, effects))
      << "nobody is expected any more";
}

TEST_F(RestartTest, AnIdThatAnAdministratorGaveIsNoNewcomers) {
  const auto before = start(1, 1);
  const Node robot = join(*before, "robot");
  Effects effects;
  const NodeIndex given{before->durable(0ms).nodes.mark};  // what the next start hands out first
  ASSERT_FALSE(before->renumber(*before->sessions().find(robot.first), given, 0ms, effects));
  EXPECT_TRUE(std::holds_alternative<StateDue>(effects.front())) << "a crash must not forget it";
  const std::vector<std::byte> token = before->sessions().token_of(*before->sessions().find(given));
  const auto after = start(before->durable(0ms), 2);
  EXPECT_EQ(join(*after, "newcomer").first, NodeIndex{given.value() + 1});
  EXPECT_EQ(join(*after, "robot", token).first, given);
}

TEST_F(RestartTest, WhereEachIdMayBeSomebodysNewcomersWait) {
  Durable kept;
  for (std::uint32_t index = 1; index < kEveryIndex; ++index) kept.nodes.used.insert(index);
  const auto hub = start(kept, 2);
  hub->state_kept(hub->durable(0ms));
  JoinRequest request;
  Effects effects;
  const std::chrono::milliseconds over{limits_.grace_ms};
  const auto refused = hub->join(request, over - 1ms, effects);
  ASSERT_FALSE(refused);
  EXPECT_EQ(refused.error().code, GoodbyeCode::hub_full);
  EXPECT_NE(refused.error().sentence.find("try again in 1 s"), std::string::npos)
      << refused.error().sentence;
  EXPECT_TRUE(effects.empty());
  EXPECT_TRUE(hub->keeping_due(over));
  hub->state_kept(hub->durable(over));
  EXPECT_TRUE(hub->join(request, over, effects));
}

TEST_F(RestartTest, OfAHubsFirstStartNobodyIsExpectedBack) {
  const auto hub = start(1, 1);
  Effects effects;
  EXPECT_FALSE(
      hub->renumber(*hub->sessions().find(join(*hub, "A").first), NodeIndex{100}, 0ms, effects));
}

TEST_F(RestartTest, AnotherNameAnotherIdentityOrAnotherHubIsNotHonoured) {
  const auto before = start(1, 1);
  const Node k = join(*before, "K");
  const auto after = start(before->durable(0ms), 2);
  EXPECT_NE(join(*after, "L", k.second).first, k.first);
  JoinRequest request;
  request.name = "K";
  request.identity = Identity::of_user(1000);
  request.token = k.second;
  Effects effects;
  EXPECT_NE((*after->join(request, 0ms, effects)).session->index, k.first);
  Sessions::Options other;
  other.hub = HubId{8};
  other.nodes = {4'097, IndexPool::kBlock};
  Membership hub_8(other, limits_);
  EXPECT_NE(join(hub_8, "K", k.second).first, k.first);
}

TEST_F(RestartTest, StateIsDueBeforeTheBlockIsUsedUpAndNothingIsHandedOutBeyondIt) {
  limits_.nodes = 10'000;
  const auto hub = start(1, 1);
  Effects effects;
  JoinRequest request;
  std::uint32_t joined = 0;
  const auto is_due = [](const Effect& effect) { return std::holds_alternative<StateDue>(effect); };
  while (std::ranges::none_of(effects, is_due) && ++joined < IndexPool::kBlock) {
    ASSERT_TRUE(hub->join(request, 0ms, effects));
  }
  EXPECT_EQ(joined, IndexPool::kBlock / 2 + 1);
  EXPECT_EQ(hub->durable(0ms).nodes.mark, 1 + 2 * IndexPool::kBlock);
  for (; joined < IndexPool::kBlock; ++joined) ASSERT_TRUE(hub->join(request, 0ms, effects));
  const auto beyond = hub->join(request, 0ms, effects);
  ASSERT_FALSE(beyond);
  EXPECT_EQ(beyond.error().code, GoodbyeCode::hub_full);
  hub->state_kept(hub->durable(0ms));
  const auto next = hub->join(request, 0ms, effects);
  ASSERT_TRUE(next);
  EXPECT_EQ(next->session->index, NodeIndex{IndexPool::kBlock + 1});
}

}  // namespace
}  // namespace gimnet::hub
