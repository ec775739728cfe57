#include "hub/control/state/index_pool.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

namespace gimnet::hub {
namespace {

using ::testing::ElementsAre;

IndexSet set_of(std::initializer_list<std::uint32_t> indices) {
  IndexSet set;
  for (const std::uint32_t index : indices) set.insert(index);
  return set;
}

std::optional<IndexSet> read(std::initializer_list<unsigned> bytes, std::uint32_t most) {
  std::vector<std::byte> list;
  for (const unsigned each : bytes) list.push_back(std::byte{static_cast<std::uint8_t>(each)});
  return IndexSet::from_bytes(list, most);
}

TEST(IndexSet, HoldsWhatWasInsertedAndNotErased) {
  IndexSet set = set_of({1, 9, 1'048'574, 9});
  EXPECT_EQ(set.size(), 3u);
  EXPECT_TRUE(set.contains(9));
  EXPECT_FALSE(set.contains(8));
  EXPECT_FALSE(set.contains(0xFFFF'FFFF));
  set.erase(9);
  set.erase(9);
  EXPECT_FALSE(set.contains(9));
  EXPECT_EQ(set.size(), 2u);
}

TEST(IndexSet, IsWithinAnotherThatHasAllOfIt) {
  IndexSet shrunk = set_of({1, 700});
  shrunk.erase(700);
}

TEST(IndexSet, BytesEndWithTheHighestIndex) {
  EXPECT_TRUE(IndexSet{}.bytes().empty());
  EXPECT_THAT(set_of({1, 9}).bytes(), ElementsAre(std::byte{2}, std::byte{2}));
  IndexSet shrunk = set_of({1, 1'000});
  shrunk.erase(1'000);
  EXPECT_THAT(shrunk.bytes(), ElementsAre(std::byte{2}));
  EXPECT_EQ(shrunk, set_of({1}));
  EXPECT_NE(shrunk, set_of({2}));
  EXPECT_EQ(set_of({1'048'574}).bytes().size(), IndexSet::bytes_max(1'048'574));
}

TEST(IndexSet, IsReadAsItWasWritten) {
  const IndexSet set = set_of({1, 8, 63, 64, 12'345});
  const auto read = IndexSet::from_bytes(set.bytes(), 12'345);
  ASSERT_TRUE(read);
  EXPECT_EQ(*read, set);
  EXPECT_EQ(read->size(), 5u);
  EXPECT_EQ(IndexSet::from_bytes({}, 10), IndexSet{});
}

TEST(IndexSet, ReadsNothingElse) {
  EXPECT_TRUE(read({0, 4}, 10));
  EXPECT_FALSE(read({0, 8}, 10)) << "one beyond";
  EXPECT_FALSE(read({2, 0}, 10)) << "a byte too many";
  EXPECT_FALSE(read({3}, 10)) << "0 is no index";
  EXPECT_FALSE(read({2, 0, 1}, 10));
}

}  // namespace
}  // namespace gimnet::hub
