#include "hub/network/state/group_trees.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <string>

namespace gimnet::hub {
namespace {

namespace route = proto::route;
using namespace std::chrono_literals;
using ::testing::ElementsAre;
using ::testing::IsEmpty;

constexpr HubId kSelf{7};
constexpr HubId kOwner{9};
constexpr LinkNumber kUp{1};
constexpr LinkNumber kOtherUp{2};
constexpr LinkNumber kDown{3};
constexpr GroupId kGroup = make_id<GroupId>(kOwner, 5);
constexpr GroupId kOwnGroup = make_id<GroupId>(kSelf, 5);

route::Join join(GroupId group, JoinTerms terms = {}, bool anew = true,
                 std::uint32_t subscribers = 1) {
  return {{{group, terms, subscribers}}, anew};
}

std::string text_of(GroupId group) { return std::to_string(index_of(group)); }

std::string text_of(const proto::Payload& bytes) {
  if (const auto said = proto::decode<route::Join>(bytes)) {
    std::string text = said->anew ? "join" : "change";
    for (const auto& each : said->groups) {
      text += " " + text_of(each.group) + ":" + std::to_string(each.terms.interval_us) + "/" +
              std::to_string(each.terms.depth);
      if (each.subscribers != 1) text += " of " + std::to_string(each.subscribers);
    }
    return text;
  }
  if (const auto said = proto::decode<route::Leave>(bytes))
    return "leave " + text_of(said->groups[0]);
  if (const auto said = proto::decode<route::Joined>(bytes))
    return "joined " + text_of(said->groups[0]);
  return proto::decode<route::JoinsEnd>(bytes) ? "end" : "?";
}

TEST(JoinTerms, AreAsWideAsTheWidest) {
  EXPECT_EQ(widest({100, 1, 2}, {200, 3, 1}), (JoinTerms{100, 3, 2}));
  EXPECT_EQ(widest({100, 1, 2}, {200, 3, 0}), (JoinTerms{100, 3, 0})) << "one wants everything";
}

class GroupTreesTest : public ::testing::Test {
 protected:
  GroupTreesTest() { way(kUp); }
  void way(LinkNumber link) {
    std::array<LinkNumber, NetworkMap::kHubIds> next_hops{};
    next_hops[kOwner.value()] = link;
    trees_.set_next_hops(next_hops);
  }
  std::vector<std::string> said() {
    std::vector<std::string> texts;
    for (const Sending& each : trees_.take_sendings(now_))
      texts.push_back(std::to_string(each.link.value()) + " " + text_of(*each.bytes));
    return texts;
  }
  void pass(std::chrono::milliseconds time) { now_ += time; }

  std::chrono::milliseconds now_{5'000};
  GroupTrees trees_{kSelf};
};

TEST_F(GroupTreesTest, JoinsOnceWithTheWidestTermsAndLeaves) {
  trees_.want(kGroup, JoinWish{{1'000'000, 1}});
  EXPECT_THAT(said(), ElementsAre("1 join 5:1000000/1"));
  trees_.take(kDown, join(kGroup, {500'000, 3}));
  EXPECT_THAT(said(), ElementsAre("1 change 5:500000/3 of 2"));
  trees_.want(kGroup, JoinWish{{}});
  EXPECT_THAT(said(), ElementsAre("1 change 5:0/3 of 2"));
  trees_.take(kDown, route::Leave{{kGroup}});
  EXPECT_THAT(said(), ElementsAre("1 change 5:0/1"));
  trees_.want(kGroup, JoinWish{{}});
  EXPECT_THAT(said(), IsEmpty());
  trees_.want(kGroup, std::nullopt);
  EXPECT_THAT(said(), ElementsAre("1 leave 5"));
  EXPECT_EQ(trees_.size(), 0u);
}

TEST_F(GroupTreesTest, SaysTheSumOfSubscribersEachHundredMilliseconds) {
  trees_.want(kGroup, JoinWish{{}, 3});
  EXPECT_THAT(said(), ElementsAre("1 join 5:0/1 of 3")) << "at once";
  EXPECT_FALSE(trees_.next_due());
  trees_.take(kDown, join(kGroup, {}, true, 40));
  EXPECT_THAT(said(), IsEmpty());
  EXPECT_EQ(trees_.next_due(), now_ + 100ms);
  pass(99ms);
  trees_.want(kGroup, JoinWish{{}, 4});
  EXPECT_THAT(said(), IsEmpty());
  pass(1ms);
  EXPECT_THAT(said(), ElementsAre("1 change 5:0/1 of 44"));
  EXPECT_FALSE(trees_.next_due());
  trees_.take(kDown, join(kGroup, {}, false, 41));
  trees_.take(kDown, join(kGroup, {}, false, 40));
  pass(100ms);
  static_cast<void>(said());
  pass(100ms);
  EXPECT_THAT(said(), IsEmpty()) << "it is the number that was said";
  trees_.take(kDown, route::Leave{{kGroup}});
  trees_.take(kUp, join(kGroup, {}, true, 7));
  static_cast<void>(said());
  pass(100ms);
  EXPECT_THAT(said(), ElementsAre("1 change 5:0/1 of 4")) << "those behind the parent are not its";
}

TEST_F(GroupTreesTest, SaysTheNumberAtOnceWithOtherTermsAndToAnotherParent) {
  trees_.want(kGroup, JoinWish{{10, 1}, 3});
  static_cast<void>(said());
  trees_.take(kDown, join(kGroup, {5, 1}, true, 2));
  EXPECT_THAT(said(), ElementsAre("1 change 5:5/1 of 5"));
  trees_.want(kGroup, JoinWish{{10, 1}, 4});
  way(kOtherUp);
  EXPECT_THAT(said(), ElementsAre("1 leave 5", "2 join 5:5/1 of 6"));
  pass(200ms);
  EXPECT_THAT(said(), IsEmpty());
}

TEST_F(GroupTreesTest, TheSumOfNumbersStopsAtTheLargest) {
  trees_.want(kGroup, JoinWish{{}, 3});
  trees_.take(kDown, join(kGroup, {}, true, UINT32_MAX - 1));
  EXPECT_THAT(said(), ElementsAre("1 join 5:0/1 of 4294967295"));
}

TEST_F(GroupTreesTest, AnotherNumberIsNoOtherBranch) {
  trees_.take(kDown, join(kOwnGroup));
  EXPECT_THAT(trees_.take_changed(), ElementsAre(kOwnGroup));
  EXPECT_THAT(trees_.take_recounted(), IsEmpty());
  static_cast<void>(said());
  trees_.take(kDown, join(kOwnGroup, {}, false, 9));
  EXPECT_THAT(trees_.take_changed(), IsEmpty());
  EXPECT_THAT(trees_.take_recounted(), ElementsAre(kOwnGroup));
  EXPECT_EQ(trees_.branches(kOwnGroup)->at(kDown).subscribers, 9u);
  EXPECT_THAT(said(), ElementsAre("3 joined 5"));
  trees_.take(kDown, join(kOwnGroup, {7, 1}, false, 9));
  EXPECT_THAT(trees_.take_changed(), ElementsAre(kOwnGroup));
}

TEST_F(GroupTreesTest, ManyNumbersGoInOneMessage) {
  for (std::uint32_t i = 1; i <= route::kGroupsMax + 1; ++i)
    trees_.want(make_id<GroupId>(kOwner, i), JoinWish{});
  static_cast<void>(said());
  for (std::uint32_t i = 1; i <= route::kGroupsMax + 1; ++i)
    trees_.want(make_id<GroupId>(kOwner, i), JoinWish{{}, 2});
  static_cast<void>(said());
  pass(100ms);
  EXPECT_EQ(said().size(), 2u);
}

TEST_F(GroupTreesTest, AsksForTheLastMessageAgainWhereItHasJoined) {
  trees_.want_anew(kGroup);
  EXPECT_THAT(said(), IsEmpty());
  trees_.want(kGroup, JoinWish{{}});
  trees_.want_anew(kGroup);
  EXPECT_THAT(said(), ElementsAre("1 join 5:0/1"));
  trees_.want_anew(kGroup);
  EXPECT_THAT(said(), ElementsAre("1 join 5:0/1"));
  EXPECT_THAT(said(), IsEmpty());
}

TEST_F(GroupTreesTest, AnswersAJoinWhenItsOwnWasAnswered) {
  trees_.take(kDown, join(kGroup));
  EXPECT_THAT(said(), ElementsAre("1 join 5:0/1"));
  EXPECT_FALSE(trees_.is_joined(kGroup));
  trees_.take(kOtherUp, route::Joined{{kGroup}});
  EXPECT_THAT(said(), IsEmpty()) << "that neighbour was not asked";
  trees_.take(kUp, route::Joined{{kGroup}});
  EXPECT_THAT(said(), ElementsAre("3 joined 5"));
  EXPECT_TRUE(trees_.is_joined(kGroup));
  trees_.take(kOtherUp, join(kGroup));
  EXPECT_THAT(said(), ElementsAre("2 joined 5"));
}

TEST_F(GroupTreesTest, AnswersForItsOwnGroupsAtOnce) {
  trees_.take(kDown, join(kOwnGroup));
  EXPECT_THAT(trees_.take_changed(), ElementsAre(kOwnGroup));
  EXPECT_THAT(said(), ElementsAre("3 joined 5"));
  EXPECT_EQ(trees_.parent(kOwnGroup), LinkNumber{});
}

TEST_F(GroupTreesTest, FollowsTheNextHop) {
  trees_.want(kGroup, JoinWish{{}});
  static_cast<void>(said());
  trees_.take(kUp, route::Joined{{kGroup}});
  way(kOtherUp);
  EXPECT_EQ(trees_.parent(kGroup), kOtherUp);
  EXPECT_THAT(said(), ElementsAre("1 leave 5", "2 join 5:0/1"));
  EXPECT_FALSE(trees_.is_joined(kGroup));
  way(LinkNumber{});
  EXPECT_THAT(said(), ElementsAre("2 leave 5"));
  way(kUp);
  EXPECT_THAT(said(), ElementsAre("1 join 5:0/1")) << "subscribers stay";
}

TEST_F(GroupTreesTest, DoesNotJoinForTheNeighbourThatItWouldJoinAt) {
  trees_.take(kUp, join(kGroup));
  EXPECT_EQ(trees_.parent(kGroup), LinkNumber{});
  EXPECT_THAT(said(), IsEmpty());
  trees_.take(kDown, join(kGroup, {20, 2}));
  EXPECT_EQ(trees_.parent(kGroup), kUp);
  EXPECT_THAT(said(), ElementsAre("1 join 5:20/2"));
}

TEST_F(GroupTreesTest, AConnectionBeginsWithAllJoins) {
  trees_.want(kGroup, JoinWish{{}});
  trees_.take(kUp, join(kOwnGroup));
  static_cast<void>(said());
  trees_.begin_connection(kUp);
  EXPECT_THAT(said(), ElementsAre("1 join 5:0/1", "1 end"));
  EXPECT_TRUE(trees_.branches(kOwnGroup)->contains(kUp)) << "until the other side has said all";
  trees_.take(kUp, route::JoinsEnd{});
  static_cast<void>(said());
  EXPECT_EQ(trees_.branches(kOwnGroup), nullptr);
  trees_.take(kUp, join(kOwnGroup));
  trees_.begin_connection(kUp);
  trees_.take(kUp, join(kOwnGroup));
  trees_.take(kUp, route::JoinsEnd{});
  EXPECT_TRUE(trees_.branches(kOwnGroup)->contains(kUp));
}

TEST_F(GroupTreesTest, ALinkThatEndsHasLeft) {
  trees_.want(kGroup, JoinWish{{}});
  trees_.take(kUp, join(kOwnGroup));
  trees_.take(kDown, join(kGroup));
  static_cast<void>(said());
  trees_.end_link(kUp);
  EXPECT_EQ(trees_.parent(kGroup), LinkNumber{});
  trees_.end_link(kDown);
  EXPECT_THAT(said(), IsEmpty());
  EXPECT_EQ(trees_.branches(kOwnGroup), nullptr);
  EXPECT_EQ(trees_.size(), 1u) << "the node here still wants it";
}

TEST_F(GroupTreesTest, ALinkJoinsABoundedNumberOfGroups) {
  for (std::uint32_t i = 1; i <= GroupTrees::kJoinsMax + 2; ++i)
    trees_.take(kDown, join(make_id<GroupId>(kOwner, i)));
  EXPECT_EQ(trees_.size(), GroupTrees::kJoinsMax);
  EXPECT_EQ(trees_.refused(), 2u);
  trees_.take(kDown, join(make_id<GroupId>(kOwner, 1), {7, 1}));
  EXPECT_EQ(trees_.refused(), 2u) << "it has that one already";
  trees_.take(kDown, route::Leave{{make_id<GroupId>(kOwner, 1)}});
  trees_.take(kDown, join(kOwnGroup));
  EXPECT_EQ(trees_.refused(), 2u);
  trees_.take(kUp, join(make_id<GroupId>(kOwner, 900'000)));
  EXPECT_EQ(trees_.refused(), 2u) << "the limit is one link's";
  EXPECT_EQ(said().size(), GroupTrees::kJoinsMax / route::kGroupsMax + 1)
      << "many groups in one message, and one answer";
}

}  // namespace
}  // namespace gimnet::hub
