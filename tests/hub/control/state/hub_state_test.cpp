#include "hub/control/state/hub_state.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "base/endian.hpp"

namespace gimnet::hub {
namespace {

using namespace std::chrono_literals;
using ::testing::HasSubstr;

HubState some_state() {
  HubState state;
  state.secret.fill(std::byte{0x11});
  state.unique_id.fill(std::byte{0x22});
  state.boot = 9;
  state.node_mark = 8'193;
  state.group_mark = 4'097;
  state.drawn_hub = HubId{1'024};
  state.kicked = {{NodeIndex{3}, 77, 5s}, {NodeIndex{1'048'574}, 78, 6s}};
  for (std::uint32_t index = 1; index < state.node_mark; ++index) state.nodes_used.insert(index);
  state.nodes_used.insert(8'200);
  return state;
}

/// With the digest that belongs to the changed bytes.
std::vector<std::byte> sealed(std::vector<std::byte> bytes) {
  bytes.resize(bytes.size() - std::tuple_size_v<Digest>);
  const Digest digest = sha256(bytes);
  bytes.insert(bytes.end(), digest.begin(), digest.end());
  return bytes;
}

std::string fault_of(std::span<const std::byte> bytes) {
  const auto state = read_hub_state(bytes);
  return state ? "" : state.error().sentence;
}

TEST(HubState, IsReadAsItWasWritten) {
  const auto state = read_hub_state(write_hub_state(some_state()));
  ASSERT_TRUE(state);
  EXPECT_EQ(*state, some_state());
  HubState full = some_state();
  full.kicked.assign(kKickedMax, {NodeIndex{1}, 2, 3s});
  full.nodes_used.insert(1'048'574);
  EXPECT_EQ(write_hub_state(full).size(), kHubStateBytesMax);
  EXPECT_EQ(*read_hub_state(write_hub_state(full)), full);
}

TEST(HubState, AnyChangedByteIsSeen) {
  const std::vector<std::byte> bytes = write_hub_state(some_state());
  for (std::size_t i = 0; i < bytes.size(); ++i) {
    std::vector<std::byte> changed = bytes;
    changed[i] ^= std::byte{1};
    EXPECT_NE(fault_of(changed), "") << "byte " << i;
  }
}

TEST(HubState, AnyOtherLengthIsRefused) {
  const std::vector<std::byte> bytes = write_hub_state(some_state());
  for (std::size_t size = 0; size < bytes.size(); ++size)
    EXPECT_NE(fault_of(std::span{bytes}.first(size)), "") << size;
  std::vector<std::byte> longer = bytes;
  longer.push_back(std::byte{});
  EXPECT_THAT(fault_of(longer), HasSubstr("length"));
  EXPECT_THAT(fault_of(std::vector<std::byte>(kHubStateBytesMax + 1)), HasSubstr("too long"));
}

TEST(HubState, SaysWhatIsWrong) {
  const std::vector<std::byte> bytes = write_hub_state(some_state());
  std::vector<std::byte> wrong = bytes;
  wrong[0] = std::byte{'X'};
  EXPECT_THAT(fault_of(sealed(wrong)), HasSubstr("does not hold"));
  wrong = bytes;
  for (const unsigned version : {0u, 3u, 5u}) {
    wrong[8] = static_cast<std::byte>(version);
    EXPECT_THAT(fault_of(sealed(wrong)), HasSubstr("version"));
  }
  wrong = bytes;
  wrong.back() ^= std::byte{1};
  EXPECT_THAT(fault_of(wrong), HasSubstr("damaged"));
  for (const std::size_t offset : {72u, 76u, 88u}) {  // node mark, group mark, a kicked index
    for (const std::uint32_t index : {0u, 1'048'575u}) {
      wrong = bytes;
      store_le(wrong.data() + offset, index);
      EXPECT_THAT(fault_of(sealed(wrong)), HasSubstr("numbers")) << offset << " " << index;
    }
  }
  for (const std::size_t length : {12u, 80u}) {  // kicked tokens, bytes of the set
    wrong = bytes;
    store_le(wrong.data() + length, 0xFFFF'FFFFu);
    EXPECT_THAT(fault_of(sealed(wrong)), HasSubstr("length")) << length;
  }
  for (const std::size_t unused : {85u, 87u, 92u, 95u}) {
    wrong = bytes;
    wrong[unused] = std::byte{1};  // of 84: hub 257, or more than a hub id
    EXPECT_THAT(fault_of(sealed(wrong)), HasSubstr("numbers")) << unused;
  }
  const std::size_t nodes_used = 88 + 2 * 24;
  wrong = bytes;
  wrong[nodes_used] |= std::byte{1};  // index 0
  EXPECT_THAT(fault_of(sealed(wrong)), HasSubstr("numbers"));
  wrong = bytes;
  wrong[wrong.size() - 33] = std::byte{0};  // the last byte of the set, which ends with a bit
  EXPECT_THAT(fault_of(sealed(wrong)), HasSubstr("numbers"));
  wrong = bytes;
  store_le(wrong.data() + 64, kBootMax + 1);
  EXPECT_THAT(fault_of(sealed(wrong)), HasSubstr("numbers"));
}

TEST(HubState, OnlyAHubIdThatCanBeDrawnIsRead) {
  for (const std::uint32_t hub : {0u, 1'024u, 4'094u, 1u, 1'023u, 4'095u, 66'560u}) {
    std::vector<std::byte> bytes = write_hub_state(some_state());
    store_le(bytes.data() + 84, hub);
    const bool right = hub == 0 || (hub >= kDrawnHubMin && hub <= kHubIdMax);
    EXPECT_EQ(fault_of(sealed(bytes)).empty(), right) << hub;
  }
}

TEST(HubState, DrawsAHubIdThatIsNotTaken) {
  const auto none = [](HubId) { return false; };
  EXPECT_EQ(draw_hub(0, none), HubId{1'024});
  EXPECT_EQ(draw_hub(3'070, none), HubId{4'094});
  EXPECT_EQ(draw_hub(3'071, none), HubId{1'024});
  EXPECT_EQ(draw_hub(3'070, [](HubId hub) { return hub > HubId{1'030} || hub < HubId{1'026}; }),
            HubId{1'026});
  EXPECT_EQ(draw_hub(5, [](HubId) { return true; }), kOwnHub);
}

TEST(HubState, TheNextStartHandsOutWhatIsAboveTheMarks) {
  const auto start = next_start(some_state(), 5s);
  ASSERT_TRUE(start);
  EXPECT_EQ(start->state.boot, 10u);
  EXPECT_EQ(start->nodes.first, 8'193u);
  EXPECT_EQ(start->nodes.count, IndexPool::kBlock + 1) << "one of them is used";
  EXPECT_EQ(start->nodes.used, some_state().nodes_used);
  EXPECT_EQ(start->state.node_mark, 8'194u + IndexPool::kBlock);
  EXPECT_EQ(start->state.nodes_used.size(), 8'193u + IndexPool::kBlock)
      << "what is granted is kept as used";
  EXPECT_TRUE(start->state.nodes_used.contains(8'193 + IndexPool::kBlock));
  EXPECT_EQ(start->groups.first, 4'097u);
  EXPECT_EQ(start->groups.count, IndexPool::kBlock);
  EXPECT_EQ(start->state.group_mark, 4'097u + IndexPool::kBlock);
  EXPECT_EQ(start->state.secret, some_state().secret);
  EXPECT_EQ(start->state.unique_id, some_state().unique_id);
  ASSERT_EQ(start->state.kicked.size(), 1u) << "the other one's token has expired";
  EXPECT_EQ(start->state.kicked[0].index, NodeIndex{1'048'574});
}

TEST(HubState, MarksComeRound) {
  HubState state;
  state.node_mark = 1'048'574;
  const auto start = next_start(state, 0s);
  ASSERT_TRUE(start);
  EXPECT_EQ(start->state.node_mark, IndexPool::kBlock);
}

TEST(HubState, AStartThatHasComeRoundHandsOutNothingThatSomebodyMayHave) {
  HubState state = some_state();
  state.node_mark = 1'048'574;
  const auto start = next_start(state, 0s);
  ASSERT_TRUE(start);
  EXPECT_EQ(start->state.node_mark, 8'193u + IndexPool::kBlock)
      << "1'048'574, then what is above those used";
  EXPECT_TRUE(start->state.nodes_used.contains(1'048'574));
}

TEST(HubState, StartsAreCountedToTheEndAndNoFurther) {
  HubState state;
  state.boot = kBootMax - 1;
  EXPECT_TRUE(next_start(state, 0s));
  state.boot = kBootMax;
  const auto beyond = next_start(state, 0s);
  ASSERT_FALSE(beyond);
  EXPECT_EQ(beyond.error().sentence,
            "the hub was started as often as can be counted (16777215 times); move it away: the "
            "hub then begins anew, "
            "and nodes get new ids");
}

}  // namespace
}  // namespace gimnet::hub
