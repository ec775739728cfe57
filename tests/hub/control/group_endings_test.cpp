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
  std::vector<std::uint32_t> answer(std::uint32_t ticket) {
    return endings_.on_passed(FencePassedEvent{{kProviders, ticket}});
  }
  std::size_t fences() const { return shards_.all<FenceCommand>().size(); }

  FakeShards shards_{3};
  GroupEndings endings_{shards_};
};

TEST_F(GroupEndingsTest, AGroupIsOverWhenEveryOtherShardHasAnswered) {
  endings_.begin(5, kProviders);
  ASSERT_EQ(fences(), 1u);
  EXPECT_EQ(shards_.sent[0].shard, kProviders);
  EXPECT_TRUE(endings_.contains(5));
  EXPECT_THAT(answer(1), IsEmpty());
  EXPECT_THAT(answer(1), ElementsAre(5u));
  endings_.finish(5);
  EXPECT_FALSE(endings_.contains(5));
}

// A fence says nothing of what was handed over behind it; and there is never more than one in the
// mailboxes.
TEST_F(GroupEndingsTest, WhatEndsMeanwhileSharesTheNextFence) {
  endings_.begin(5, kProviders);
  for (const std::uint32_t group : {6u, 7u, 8u}) endings_.begin(group, kProviders);
  EXPECT_EQ(fences(), 1u);
  EXPECT_THAT(answer(1), IsEmpty());
  EXPECT_THAT(answer(1), ElementsAre(5u));
  EXPECT_EQ(fences(), 2u);
  EXPECT_THAT(answer(2), IsEmpty());
  EXPECT_THAT(answer(2), ElementsAre(6u, 7u, 8u));
  EXPECT_EQ(fences(), 2u) << "nothing ends";
}

TEST_F(GroupEndingsTest, EachProvidersShardHasItsOwn) {
  endings_.begin(5, kProviders);
  endings_.begin(6, ShardIndex{2});
  EXPECT_EQ(fences(), 2u);
  for (int i = 0; i < 2; ++i) {
    const auto over = endings_.on_passed(FencePassedEvent{{ShardIndex{2}, 1}});
    EXPECT_EQ(over, i == 0 ? std::vector<std::uint32_t>{} : std::vector<std::uint32_t>{6});
  }
  EXPECT_TRUE(endings_.contains(5));
}

TEST_F(GroupEndingsTest, APaceEndsWithItsGroup) {
  endings_.begin(5, kProviders);
  endings_.defer(5, ShardIndex{1}, EndPaceCommand{{}, GroupId{5}, true});
  EXPECT_THAT(shards_.all<EndPaceCommand>(), IsEmpty());
  endings_.finish(5);
  ASSERT_THAT(shards_.all<EndPaceCommand>(), SizeIs(1));
  EXPECT_EQ(shards_.sent.back().shard, ShardIndex{1});
  endings_.finish(5);
  EXPECT_THAT(shards_.all<EndPaceCommand>(), SizeIs(1));
}

// A provider that comes back gets its former group.
TEST_F(GroupEndingsTest, AGroupThatBeganAnewIsNotOverByAnEarlierFence) {
  endings_.begin(5, kProviders);
  endings_.finish(5);
  endings_.begin(5, kProviders);
  EXPECT_THAT(answer(1), IsEmpty());
  EXPECT_THAT(answer(1), IsEmpty());
  EXPECT_THAT(answer(2), IsEmpty());
  EXPECT_THAT(answer(2), ElementsAre(5u));
}

}  // namespace
}  // namespace gimnet::hub
