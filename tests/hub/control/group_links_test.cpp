#include "hub/control/group_links.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "tests/hub/control/support/link_rig.hpp"

namespace gimnet::hub {
namespace {

namespace route = proto::route;
using namespace std::chrono_literals;
using ::testing::ElementsAre;
using ::testing::IsEmpty;
using ::testing::SizeIs;

constexpr HubId kSelf{7};
constexpr HubId kNear{20};
constexpr HubId kFar{30};
constexpr LinkNumber kUp{1};
constexpr LinkNumber kDown{2};
constexpr Place kUpPlace{ShardIndex{0}, ConnectionSlot{10}, 100};
constexpr Place kDownPlace{ShardIndex{0}, ConnectionSlot{11}, 101};
constexpr GroupId kOwnGroup = make_id<GroupId>(kSelf, 1);
constexpr GroupId kAwayGroup = make_id<GroupId>(kFar, 5);

/// The groups of hub 7, which has a link up to hub 20, behind which hub 30 is, and one down.
class GroupLinksTest : public ::testing::Test {
 protected:
  GroupLinksTest() : rig_(kSelf.value(), LinkRig::accepting()) {
    groups().set_place(kUp, kUpPlace, kNear);
    groups().set_place(kDown, kDownPlace, HubId{40});
    HubIdentity self{{kSelf, {}}, {}};
    RecordStore store;
    for (const auto& [hub, neighbours] :
         {std::pair{kSelf, std::vector{kNear}}, std::pair{kNear, std::vector{kSelf, kFar}},
          std::pair{kFar, std::vector{kNear}}}) {
      route::RecordPart part;
      part.hub.hub = hub;
      part.sequence = 1;
      for (const HubId neighbour : neighbours) part.neighbours.push_back({{neighbour, {}}, 1});
      static_cast<void>(store.take(make_part(part), 0ms));
    }
    groups().set_next_hops(
        NetworkMap(self, store, std::vector<CarryingLink>{{{{kNear, {}}, 1}, kUp}}));
  }
  GroupLinks& groups() { return rig_.groups; }
  template <class Message>
  std::vector<Sending> take(LinkNumber link, const Message& message) {
    groups().take(link, proto::encode(message));
    return groups().take_sendings(0ms);
  }
  std::vector<Sending> join(LinkNumber link, GroupId group, JoinTerms terms = {}) {
    return take(link, route::Join{{{group, terms}}, true});
  }
  void advertise(bool retain = false) {
    JoinRequest request;
    request.name = "robot";
    Effects effects;
    const Session& robot = *rig_.membership.join(request, 0ms, effects)->session;
    ServiceTerms terms;
    terms.retain = retain;
    ASSERT_TRUE(
        rig_.membership.services().advertise(robot.index, "robot/scan", terms, 0ms, effects));
    rig_.publisher.publish_group(GroupIndex{1}, rig_.membership);
    groups().note_own(GroupIndex{1});
  }
  const GroupMembers* members(GroupId group) { return rig_.group_table.find(group); }
  const GroupMembers* away() { return rig_.group_table.find_away(kAwayGroup); }

  LinkRig rig_;
};

TEST_F(GroupLinksTest, ALinkIsAMemberOfAGroupThatItJoinedOnce) {
  advertise();
  EXPECT_THAT(join(kDown, kOwnGroup), SizeIs(1)) << "JOINED";
  EXPECT_THAT(join(kDown, kOwnGroup), SizeIs(1));
  const auto& list = members(kOwnGroup)->by_shard[0];
  ASSERT_EQ(list.size(), 1u);
  EXPECT_EQ(list.find(kDownPlace.slot)->generation, kDownPlace.generation);
  const Effects effects = groups().take_effects();
  ASSERT_THAT(effects, SizeIs(1)) << "its provider hears of one subscriber";
  EXPECT_EQ(rig_.membership.topics().find("robot/scan")->subscriber_count(), 1u);
  static_cast<void>(take(kDown, route::Leave{{kOwnGroup}}));
  EXPECT_EQ(members(kOwnGroup)->by_shard[0].size(), 0u);
  EXPECT_EQ(rig_.membership.topics().find("robot/scan")->subscriber_count(), 0u);
}

TEST_F(GroupLinksTest, AProviderHearsOfAllSubscribersBehindALink) {
  advertise();
  const auto count = [&] {
    return rig_.membership.topics().find("robot/scan")->subscriber_count();
  };
  static_cast<void>(take(kDown, route::Join{{{kOwnGroup, {}, 40}}, true}));
  EXPECT_EQ(count(), 40u);
  static_cast<void>(take(kUp, route::Join{{{kOwnGroup, {}, 2}}, true}));
  EXPECT_EQ(count(), 42u);
  static_cast<void>(groups().take_effects());
  const GroupMembers* const published = members(kOwnGroup);
  static_cast<void>(take(kDown, route::Join{{{kOwnGroup, {}, 41}}, false}));
  EXPECT_EQ(count(), 43u);
  EXPECT_THAT(groups().take_effects(), SizeIs(1));
  EXPECT_EQ(members(kOwnGroup), published) << "only the number changed";
  static_cast<void>(take(kUp, route::Join{{{kOwnGroup, {}, UINT32_MAX}}, false}));
  EXPECT_EQ(count(), UINT32_MAX) << "a hub may say anything";
  groups().end_link(kUp);
  EXPECT_EQ(count(), 41u);
}

TEST_F(GroupLinksTest, PassesTheSumOfSubscribersOn) {
  const auto said = [](const std::vector<Sending>& sendings) {
    std::vector<std::uint32_t> numbers;
    for (const Sending& each : sendings) {
      if (const auto join = proto::decode<route::Join>(*each.bytes))
        numbers.push_back(join->groups.at(0).subscribers);
    }
    return numbers;
  };
  groups().take(kDown, proto::encode(route::Join{{{kAwayGroup, {}, 40}}, true}));
  EXPECT_THAT(said(groups().take_sendings(0ms)), ElementsAre(40));
  groups().take(kDown, proto::encode(route::Join{{{kAwayGroup, {}, 41}}, false}));
  EXPECT_THAT(said(groups().take_sendings(10ms)), IsEmpty());
  EXPECT_EQ(groups().next_due(), 110ms);
  EXPECT_THAT(said(groups().take_sendings(110ms)), ElementsAre(41));
}

TEST_F(GroupLinksTest, AJoinWaitsForAGroupThatDoesNotExist) {
  EXPECT_THAT(join(kDown, kOwnGroup), SizeIs(1));
  EXPECT_EQ(members(kOwnGroup), nullptr);
  advertise();
  EXPECT_EQ(members(kOwnGroup)->by_shard[0].size(), 1u);
}

TEST_F(GroupLinksTest, ALinkIsPacedAsItsTermsSay) {
  advertise();
  static_cast<void>(join(kDown, kOwnGroup, {1'000'000, 60'000}));
  EXPECT_EQ(members(kOwnGroup)->by_shard[0].size(), 0u);
  EXPECT_EQ(members(kOwnGroup)->paced_by_shard.at(0).size(), 1u);
  const PaceCommand* pace = rig_.shards.all<PaceCommand>().back();
  EXPECT_EQ(pace->terms, (PaceTerms{0, 64, 1'000'000})) << "no more than one node may hold";
  static_cast<void>(take(kDown, route::Join{{{kOwnGroup, {0, 1, 3}}}, false}));
  EXPECT_EQ(rig_.shards.all<PaceCommand>().back()->terms, (PaceTerms{2, 1, 0}))
      << "one of three is on its way";
  static_cast<void>(take(kDown, route::Join{{{kOwnGroup, {0, 1, 1}}}, false}));
  EXPECT_EQ(rig_.shards.all<PaceCommand>().back()->terms, (PaceTerms{1, 1, 0}));
  static_cast<void>(take(kDown, route::Join{{{kOwnGroup, {}}}, false}));
  EXPECT_EQ(rig_.shards.all<PaceCommand>().back()->terms, (PaceTerms{0, 1, 0}));
  EXPECT_EQ(members(kOwnGroup)->paced_by_shard.at(0).size(), 1u)
      << "what is held for it goes before what comes";
  groups().end_link(kDown);
  EXPECT_THAT(members(kOwnGroup)->paced_by_shard, IsEmpty());
  EXPECT_THAT(rig_.shards.all<EndPaceCommand>(), SizeIs(1));
}

TEST_F(GroupLinksTest, ARetainedGroupBeginsAnewWithEachConnection) {
  advertise(true);
  static_cast<void>(join(kDown, kOwnGroup));
  ASSERT_THAT(rig_.shards.all<PaceCommand>(), SizeIs(1));
  EXPECT_TRUE(rig_.shards.all<PaceCommand>().back()->retained);
  static_cast<void>(take(kDown, route::Join{{{kOwnGroup, {5, 1}}}, false}));
  EXPECT_THAT(rig_.shards.all<EndPaceCommand>(), IsEmpty()) << "only other terms";
  groups().begin_connection(kDown);
  static_cast<void>(join(kDown, kOwnGroup, {5, 1}));
  EXPECT_THAT(rig_.shards.all<EndPaceCommand>(), SizeIs(1));
  EXPECT_THAT(rig_.shards.all<PaceCommand>(), SizeIs(3));
}

TEST_F(GroupLinksTest, PassesAGroupOfAnotherHubOn) {
  EXPECT_THAT(join(kDown, kAwayGroup), SizeIs(1)) << "JOIN at the parent";
  ASSERT_NE(away(), nullptr);
  EXPECT_EQ(away()->parent, kNear);
  EXPECT_EQ(away()->provider_place.slot, kUpPlace.slot);
  EXPECT_EQ(away()->by_shard[0].size(), 1u);
  static_cast<void>(join(kUp, kAwayGroup));
  EXPECT_EQ(away()->by_shard[0].size(), 1u) << "never back to the parent";
  static_cast<void>(take(kDown, route::Leave{{kAwayGroup}}));
  EXPECT_EQ(away(), nullptr) << "the neighbour wants it from here, and is the way to it";
  static_cast<void>(take(kUp, route::Leave{{kAwayGroup}}));
  static_cast<void>(join(kDown, make_id<GroupId>(HubId{31}, 1)));
  EXPECT_EQ(rig_.group_table.find_away(make_id<GroupId>(HubId{31}, 1)), nullptr)
      << "there is no way to that hub";
}

TEST_F(GroupLinksTest, AnAnswerWaitsUntilMessagesComeOrASecond) {
  static_cast<void>(join(kDown, kAwayGroup));
  for (const bool joined : {false, true}) {
    SendControlCommand answer;
    answer.answers = 1;
    ASSERT_TRUE(groups().hold(kAwayGroup, ShardIndex{0}, answer, 0ms));
    const std::size_t sent = rig_.shards.all<SendControlCommand>().size();
    groups().release(999ms);
    EXPECT_EQ(rig_.shards.all<SendControlCommand>().size(), sent);
    EXPECT_EQ(groups().next_due(), 1'000ms);
    if (joined) static_cast<void>(take(kUp, route::Joined{{kAwayGroup}}));
    groups().release(joined ? 999ms : 1'000ms);
    EXPECT_EQ(rig_.shards.all<SendControlCommand>().size(), sent + 1);
    EXPECT_FALSE(groups().next_due());
  }
  SendControlCommand answer;
  EXPECT_FALSE(groups().hold(kAwayGroup, ShardIndex{0}, answer, 0ms)) << "they come";
  EXPECT_FALSE(groups().hold(make_id<GroupId>(HubId{31}, 1), ShardIndex{0}, answer, 0ms))
      << "there is no way to that hub";
}

TEST_F(GroupLinksTest, CountsWhatItDoesNotUnderstand) {
  proto::Payload bytes = proto::encode(route::Leave{{kOwnGroup}});
  bytes.pop_back();
  groups().take(kDown, bytes);
  EXPECT_EQ(groups().malformed(), 1u);
}

}  // namespace
}  // namespace gimnet::hub
