#include "hub/control/handle/request.hpp"

#include <gtest/gtest.h>

namespace gimnet::hub {
namespace {

TEST(PageBudget, CountsRecords) {
  Limits limits;
  limits.page_records = 3;
  for (const std::uint32_t wanted : {3u, 4u, 0xffffffffu}) {
    PageBudget budget(limits, wanted);
    for (int i = 0; i < 3; ++i) EXPECT_TRUE(budget.take(10));
    EXPECT_FALSE(budget.take(10));
  }
  PageBudget one(limits, 0);  // an answer without a record could never go on
  EXPECT_TRUE(one.take(10));
  EXPECT_FALSE(one.take(10));
}

TEST(PageBudget, KeepsTheAnswerWithinAFrame) {
  const Limits limits;
  PageBudget budget(limits, 256);
  std::size_t bytes = 0;
  while (budget.take(1'000)) bytes += 1'000;
  EXPECT_LE(bytes, limits.frame_bytes);
  EXPECT_GT(bytes, limits.frame_bytes - 2'000);
}

TEST(OwnIndex, TakesThisHubsIdsAndThoseWithoutAHub) {
  HubFacts facts;
  facts.id = HubId{7};
  EXPECT_EQ(own_index(facts, make_id<NodeId>(HubId{7}, 5)), NodeIndex{5});
  EXPECT_EQ(own_index(facts, NodeId{5}), NodeIndex{5});
  EXPECT_EQ(own_index(facts, make_id<NodeId>(HubId{8}, 5)), std::nullopt);
  EXPECT_EQ(own_index(facts, make_id<GroupId>(HubId{7}, 5)), GroupIndex{5});
  EXPECT_EQ(own_index(facts, make_id<GroupId>(HubId{8}, 5)), std::nullopt);
}

}  // namespace
}  // namespace gimnet::hub
