#include "tools/demo/node_port.hpp"

#include <gtest/gtest.h>

namespace gimnet::demo {
namespace {

TEST(HubCounters, SumsShardsAndKnowsAnExactLedger) {
  HubCounters counters;
  for (int shard = 0; shard < 2; ++shard) {
    counters.add("accepted", 10);
    counters.add("copies", 5);
    counters.add("delivered", 12);
    counters.add("queued", 1);
    counters.add("dropped.replaced", 2);
    counters.add("received_bytes", 999);
  }
  EXPECT_EQ(counters.accepted, 20U);
  EXPECT_EQ(counters.dropped(), 4U);
  EXPECT_TRUE(counters.exact());
  EXPECT_EQ(counters.drops.at("replaced"), 4U);
  counters.add("dropped.queue_full", 1);
  EXPECT_FALSE(counters.exact());
  EXPECT_EQ(counters.drops.at("queue_full"), 1U);
}

TEST(HubCounters, WithoutDropsThereAreNone) {
  HubCounters counters;
  counters.add("dropped.away", 0);
  EXPECT_TRUE(counters.drops.empty());
  EXPECT_TRUE(counters.exact());
}

}  // namespace
}  // namespace gimnet::demo
