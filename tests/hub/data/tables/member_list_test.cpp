#include "hub/data/tables/member_list.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <deque>
#include <map>
#include <random>

#include "hub/data/tables/group_table.hpp"

namespace gimnet::hub {
namespace {

using List = MemberList<GroupMember>;
using Reference = std::map<std::uint32_t, std::uint32_t>;  ///< slot to generation

GroupMember member(std::uint32_t slot, std::uint32_t generation) {
  return {ConnectionSlot{slot}, generation};
}

Reference content(const List& list) {
  Reference found;
  std::uint32_t last = 0;
  list.for_each([&](const GroupMember& each) {
    EXPECT_TRUE(found.empty() || each.slot.value() > last) << "in the order of slots";
    last = each.slot.value();
    found[last] = each.generation;
  });
  EXPECT_EQ(found.size(), list.size());
  return found;
}

TEST(MemberList, HasEachSlotOnce) {
  List list{member(3, 30), member(1, 10), member(2, 20)};
  EXPECT_EQ(content(list), (Reference{{1, 10}, {2, 20}, {3, 30}}));
  list.put(member(2, 21));
  EXPECT_EQ(list.size(), 3u);
  EXPECT_EQ(list.find(ConnectionSlot{2})->generation, 21u);
  EXPECT_EQ(list.find(ConnectionSlot{4}), nullptr);
  EXPECT_EQ(list.find(ConnectionSlot{0}), nullptr);
  EXPECT_TRUE(list.erase(ConnectionSlot{1}));
  EXPECT_FALSE(list.erase(ConnectionSlot{1}));
  EXPECT_FALSE(list.erase(ConnectionSlot{9}));
  EXPECT_EQ(content(list), (Reference{{2, 21}, {3, 30}}));
}

TEST(MemberList, AnEmptyOneHasNothing) {
  List list;
  EXPECT_TRUE(list.empty());
  EXPECT_EQ(list.find(ConnectionSlot{0}), nullptr);
  EXPECT_FALSE(list.erase(ConnectionSlot{0}));
  list.put(member(5, 1));
  EXPECT_TRUE(list.erase(ConnectionSlot{5}));
  EXPECT_TRUE(list.empty());
  EXPECT_EQ(list.chunks(), 0u);
  EXPECT_EQ(content(list), Reference{});
}

TEST(MemberList, ACopyStaysAsItWas) {
  List list;
  for (std::uint32_t slot = 0; slot < 1'000; ++slot) list.put(member(slot, 1));
  const List copy = list;
  const Reference before = content(copy);
  list.put(member(500, 2));
  list.put(member(2'000, 1));
  EXPECT_TRUE(list.erase(ConnectionSlot{0}));
  EXPECT_EQ(content(copy), before);
  List other = copy;
  List moved = std::move(list);
  EXPECT_EQ(content(moved).size(), 1'000u);
  other = moved;
  EXPECT_EQ(content(other), content(moved));
  EXPECT_EQ(content(copy), before);
}

TEST(MemberList, ChunksAreFullWhereSlotsCameInOrderAndHalfFullAtLeastOtherwise) {
  constexpr std::uint32_t kMembers = 40 * List::kChunkMembers;
  List in_order;
  for (std::uint32_t slot = 0; slot < kMembers; ++slot) in_order.put(member(slot, 1));
  EXPECT_EQ(in_order.chunks(), 40u);
  List backwards;
  for (std::uint32_t slot = kMembers; slot > 0; --slot) backwards.put(member(slot, 1));
  EXPECT_LE(backwards.chunks(), 80u);
  // Few that are left are in few chunks.
  for (std::uint32_t slot = 0; slot < kMembers; ++slot) {
    if (slot % 64 != 0) in_order.erase(ConnectionSlot{slot});
  }
  EXPECT_EQ(in_order.size(), kMembers / 64);
  EXPECT_LE(in_order.chunks(), 6u);
}

TEST(MemberList, IsLikeAMapWhateverIsDoneWithItAndItsCopies) {
  std::mt19937 random(7);
  for (const std::uint32_t slots : {3u, 300u, 5'000u}) {
    List list;
    Reference reference;
    std::deque<std::pair<List, Reference>> copies;
    for (int i = 0; i < 30'000; ++i) {
      // It fills up, empties, and so on.
      const bool filling = (i / 8'000) % 2 == 0;
      const std::uint32_t slot = static_cast<std::uint32_t>(random()) % slots;
      if (random() % 8 < (filling ? 6u : 2u)) {
        list.put(member(slot, static_cast<std::uint32_t>(i)));
        reference[slot] = static_cast<std::uint32_t>(i);
      } else {
        ASSERT_EQ(list.erase(ConnectionSlot{slot}), reference.erase(slot) == 1);
      }
      const GroupMember* found = list.find(ConnectionSlot{slot});
      ASSERT_EQ(found != nullptr, reference.contains(slot));
      ASSERT_TRUE(found == nullptr || found->generation == reference[slot]);
      ASSERT_EQ(list.size(), reference.size());
      if (i % 1'000 == 0) copies.emplace_back(list, reference);
      if (copies.size() > 5) {
        ASSERT_EQ(content(copies.front().first), copies.front().second);
        // Sometimes the copy goes on, and the original is the one that stays.
        if (random() % 2 == 0) {
          std::swap(list, copies.front().first);
          std::swap(reference, copies.front().second);
        }
        copies.pop_front();
      }
    }
    ASSERT_EQ(content(list), reference);
    for (const auto& [copy, then] : copies) ASSERT_EQ(content(copy), then);
  }
}

}  // namespace
}  // namespace gimnet::hub
