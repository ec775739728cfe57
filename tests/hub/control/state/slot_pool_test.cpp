#include "hub/control/state/slot_pool.hpp"

#include <gtest/gtest.h>

#include <set>

namespace gimnet::hub {
namespace {

TEST(SlotPool, SpreadsEvenlyInTurns) {
  SlotPool pool(3);
  for (std::uint8_t i = 0; i < 9; ++i)
    EXPECT_EQ(pool.take().shard, ShardIndex{static_cast<std::uint8_t>(i % 3)});
  for (std::uint8_t i = 0; i < 3; ++i) EXPECT_EQ(pool.load(ShardIndex{i}), 3u);
}

TEST(SlotPool, PrefersTheLeastLoadedShard) {
  SlotPool pool(2);
  const Place first = pool.take_on(ShardIndex{0});
  const Place second = pool.take_on(ShardIndex{0});
  EXPECT_NE(second.slot, first.slot);
  EXPECT_EQ(pool.take().shard, ShardIndex{1});
  EXPECT_EQ(pool.take().shard, ShardIndex{1});
  pool.give_back(first);
  EXPECT_EQ(pool.take().shard, ShardIndex{0});
}

TEST(SlotPool, SlotsAreDenseAndReused) {
  SlotPool pool(1);
  const Place a = pool.take();
  const Place b = pool.take();
  EXPECT_EQ(a.slot, ConnectionSlot{0});
  EXPECT_EQ(b.slot, ConnectionSlot{1});
  pool.give_back(a);
  const Place c = pool.take();
  EXPECT_EQ(c.slot, a.slot);
  EXPECT_NE(c.generation, a.generation);
}

TEST(SlotPool, GenerationsAreNeverZeroNorRepeated) {
  SlotPool pool(2);
  std::set<std::uint32_t> seen;
  for (int i = 0; i < 100; ++i) {
    const Place place = pool.take();
    EXPECT_NE(place.generation, 0u);
    EXPECT_TRUE(seen.insert(place.generation).second);
    pool.give_back(place);
  }
}

}  // namespace
}  // namespace gimnet::hub
