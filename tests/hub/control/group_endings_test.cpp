#include "hub/control/group_endings.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "tests/hub/control/support/fake_shards.hpp"

namespace gimnet::hub {
namespace {

using ::testing::ElementsAre;
using ::testing::IsEmpty;
using ::testing::SizeIs;

constexpr ShardIndex kProviders{0};

class GroupEndingsTest : public ::testing::Test {
 protected:
  std::vector<GroupIndex> answer(std::uint32_t ticket) {
    return endings_.on_passed(FencePassedEvent{{kProviders, ticket}});
  }
  std::size_t fences() const { return shards_.all<FenceCommand>().size(); }

  FakeShards shards_{3};
  GroupEndings endings_{shards_};
};

TEST_F(GroupEndingsTest, AGroupIsOverWhenEveryOtherShardHasAnswered) {
  endings_.begin(GroupIndex{5}, kProviders);
  ASSERT_EQ(fences(), 1u);
  EXPECT_EQ(shards_.sent[0].shard, kProviders);
  EXPECT_TRUE(endings_.contains(GroupIndex{5}));
  EXPECT_THAT(answer(1), IsEmpty());
  EXPECT_THAT(answer(1), ElementsAre(GroupIndex{5}));
  endings_.finish(GroupIndex{5});
  EXPECT_FALSE(endings_.contains(GroupIndex{5}));
}

// A fence says nothing of what was handed over behind it; and there is never more than one in the
// mailboxes.
TEST_F(GroupEndingsTest, WhatEndsMeanwhileSharesTheNextFence) {
  endings_.begin(GroupIndex{5}, kProviders);
  for (const std::uint32_t group : {6u, 7u, 8u}) endings_.begin(GroupIndex{group}, kProviders);
  EXPECT_EQ(fences(), 1u);
  EXPECT_THAT(answer(1), IsEmpty());
  EXPECT_THAT(answer(1), ElementsAre(GroupIndex{5}));
  EXPECT_EQ(fences(), 2u);
  EXPECT_THAT(answer(2), IsEmpty());
  EXPECT_THAT(answer(2), ElementsAre(GroupIndex{6}, GroupIndex{7}, GroupIndex{8}));
  EXPECT_EQ(fences(), 2u) << "nothing ends";
}

TEST_F(GroupEndingsTest, EachProvidersShardHasItsOwn) {
  endings_.begin(GroupIndex{5}, kProviders);
  endings_.begin(GroupIndex{6}, ShardIndex{2});
  EXPECT_EQ(fences(), 2u);
  for (int i = 0; i < 2; ++i) {
    const auto over = endings_.on_passed(FencePassedEvent{{ShardIndex{2}, 1}});
    EXPECT_EQ(over, i == 0 ? std::vector<GroupIndex>{} : std::vector{GroupIndex{6}});
  }
  EXPECT_TRUE(endings_.contains(GroupIndex{5}));
}

TEST_F(GroupEndingsTest, APaceEndsWithItsGroup) {
  endings_.begin(GroupIndex{5}, kProviders);
  endings_.defer(GroupIndex{5}, ShardIndex{1}, EndPaceCommand{{}, GroupId{5}, true});
  EXPECT_THAT(shards_.all<EndPaceCommand>(), IsEmpty());
  endings_.finish(GroupIndex{5});
  ASSERT_THAT(shards_.all<EndPaceCommand>(), SizeIs(1));
  EXPECT_EQ(shards_.sent.back().shard, ShardIndex{1});
  endings_.finish(GroupIndex{5});
  EXPECT_THAT(shards_.all<EndPaceCommand>(), SizeIs(1));
}

// A provider that comes back gets its former group.
TEST_F(GroupEndingsTest, AGroupThatBeganAnewIsNotOverByAnEarlierFence) {
  endings_.begin(GroupIndex{5}, kProviders);
  endings_.finish(GroupIndex{5});
  endings_.begin(GroupIndex{5}, kProviders);
  EXPECT_THAT(answer(1), IsEmpty());
  EXPECT_THAT(answer(1), IsEmpty());
  EXPECT_THAT(answer(2), IsEmpty());
  EXPECT_THAT(answer(2), ElementsAre(GroupIndex{5}));
}

}  // namespace
}  // namespace gimnet::hub
