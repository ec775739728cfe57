#include "hub/data/flat_map.hpp"

#include <gtest/gtest.h>

#include <cstdint>
#include <set>

namespace gimnet::hub {
namespace {

using Map = FlatMap<std::uint64_t, std::uint64_t>;

TEST(FlatMap, FindsWhatWasPut) {
  Map map;
  EXPECT_EQ(map[7], 0u);
  map[7] = 1;
  map[8] = 2;
  EXPECT_EQ(map.size(), 2u);
  ASSERT_NE(map.find(7), map.end());
  EXPECT_EQ(map.find(7)->second, 1u);
  EXPECT_EQ(map.find(9), map.end());
}

TEST(FlatMap, KeepsItsMemoryWhenItIsCleared) {
  Map map;
  std::set<const void*> places;
  for (std::uint64_t key = 0; key < 100; ++key) places.insert(&map[key]);
  const std::size_t buckets = map.bucket_count();
  for (int round = 0; round < 3; ++round) {
    map.clear();
    EXPECT_EQ(map.size(), 0u);
    EXPECT_EQ(map.find(5), map.end());
    for (std::uint64_t key = 1000; key < 1100; ++key) {
      EXPECT_EQ(map[key], 0u);
      map[key] = key;
    }
    EXPECT_EQ(map.bucket_count(), buckets);
    EXPECT_EQ(map.find(1005)->second, 1005u);
#if BOOST_VERSION < 108100
    for (std::uint64_t key = 1000; key < 1100; ++key) EXPECT_TRUE(places.contains(&map[key]));
#endif
  }
}

}  // namespace
}  // namespace gimnet::hub
