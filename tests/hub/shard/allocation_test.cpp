// After a warm-up a shard's turn allocates nothing: 10^6 frames through two shards, counted at
// operator new. What the test itself needs (the fake nodes' memory) is kept by then, and only turns
// are counted.

#include <gtest/gtest.h>

#include <cstdlib>
#include <new>

#include "tests/hub/shard/support/hub_rig.hpp"

namespace {
bool counting = false;
std::uint64_t allocations = 0;

void* allocate(std::size_t size, std::size_t alignment) {
  if (counting) ++allocations;
  void* memory =
      alignment <= alignof(std::max_align_t)
          ? std::malloc(size)
          : std::aligned_alloc(alignment, (size + alignment - 1) / alignment * alignment);
  if (memory == nullptr) std::abort();
  return memory;
}
}  // namespace

void* operator new(std::size_t size) { return allocate(size, 1); }
void* operator new[](std::size_t size) { return allocate(size, 1); }
void* operator new(std::size_t size, std::align_val_t alignment) {
  return allocate(size, static_cast<std::size_t>(alignment));
}
void operator delete(void* memory) noexcept { std::free(memory); }
void operator delete[](void* memory) noexcept { std::free(memory); }
void operator delete(void* memory, std::size_t) noexcept { std::free(memory); }
void operator delete[](void* memory, std::size_t) noexcept { std::free(memory); }
void operator delete(void* memory, std::align_val_t) noexcept { std::free(memory); }
void operator delete(void* memory, std::size_t, std::align_val_t) noexcept { std::free(memory); }

namespace gimnet::hub {
namespace {

using testing::FakeNode;
using testing::HubRig;

class Allocation : public ::testing::Test {
 protected:
  /// One round: every sender's bytes are there, both shards take two turns, every recipient's bytes
  /// are thrown away.
  void round(std::uint64_t& frames) {
    for (const auto& [node, bytes] : written) node->pipe.write(bytes);
    ready[0] = rig.ready(0);
    ready[1] = rig.ready(1);
    const std::uint64_t before = rig.ledger().accepted;
    counting = true;
    for (int i = 0; i < 2; ++i) {
      for (std::size_t shard = 0; shard < 2; ++shard)
        rig.shard(shard).turn(ready[shard], rig.now_ms);
    }
    counting = false;
    frames += rig.ledger().accepted - before;
    for (FakeNode* node : nodes) {
      trash.clear();
      node->pipe.read(trash);
    }
  }
  void run(std::uint64_t frames_wanted) {
    std::uint64_t warm = 0;
    for (int i = 0; i < 50; ++i) round(warm);
    allocations = 0;
    std::uint64_t frames = 0;
    while (frames < frames_wanted) round(frames);
    EXPECT_EQ(allocations, 0u) << "in " << frames << " frames";
    EXPECT_TRUE(rig.ledger().exact());
    // Paced subscribers that credit nothing get nothing more: what is held is replaced by the
    // newest.
    EXPECT_EQ(rig.ledger().dropped, rig.dropped(proto::DropReason::replaced));
    EXPECT_EQ(rig.ledger().dropped != 0, paced);
  }
  void add(FakeNode& from, std::uint32_t dst, const std::string& payload,
           const testing::FrameSpec& spec = {}) {
    if (written.empty() || written.back().first != &from) written.push_back({&from, {}});
    const auto frame = HubRig::frame(from, dst, payload, spec);
    written.back().second.insert(written.back().second.end(), frame.begin(), frame.end());
  }

  HubRig rig{2};
  std::vector<FakeNode*> nodes;
  std::vector<std::pair<FakeNode*, std::vector<std::byte>>> written;
  std::vector<Ready> ready[2];
  std::vector<std::byte> trash;
  bool paced = false;
};

TEST_F(Allocation, NoneForAMillionFramesToOneAndInTurns) {
  for (std::size_t i = 0; i < 6; ++i) nodes.push_back(&rig.join(i % 2));
  for (int i = 0; i < 200; ++i) add(*nodes[0], nodes[2]->id.value(), "to one here");
  for (int i = 0; i < 200; ++i) add(*nodes[1], nodes[2]->id.value(), "to one there");
  // In turns: every frame another recipient, another lane.
  for (std::size_t i = 0; i < 200; ++i) {
    add(*nodes[3], nodes[i % 6]->id.value(), "in turns",
        {.lane = static_cast<std::uint8_t>(i % 4)});
  }
  for (int i = 0; i < 4; ++i) add(*nodes[4], nodes[5]->id.value(), std::string(20'000, 'L'));
  run(1'000'000);
}

// Each recipient of a read begins a chunk in the same turn, and a read may have thousands.
TEST_F(Allocation, NoneForAReadThatSpeaksToThousands) {
  FakeNode& sender = rig.join(0);
  constexpr std::size_t kRecipients = 5'000;
  for (std::size_t i = 0; i < kRecipients; ++i) nodes.push_back(&rig.join(0));
  for (const FakeNode* node : nodes) add(sender, node->id.value(), "");
  run(3 * kRecipients);
}

TEST_F(Allocation, NoneForPacedSubscriptionsAndARetainedGroup) {
  paced = true;
  for (std::size_t i = 0; i < 8; ++i) nodes.push_back(&rig.join(i % 2));
  rig.publish_paced_group(1, nodes[0]->id, nodes, true);
  for (std::size_t i = 0; i < 8; ++i) {
    const PaceTerms terms{
        .window = i % 3 == 0 ? 2u : 0u, .depth = 3, .interval_us = i % 3 == 1 ? 1'000'000u : 0u};
    rig.pace(*nodes[i], 1, terms, true);
  }
  rig.settle();
  for (int i = 0; i < 20; ++i) {
    add(*nodes[0], HubRig::group(1), "small", {.kind = proto::Kind::group});
    add(*nodes[0], HubRig::group(1), std::string(3'000, 'm'),
        {.kind = proto::Kind::group, .lane = 2});
  }
  run(20'000);
}

TEST_F(Allocation, NoneForFanOut) {
  for (std::size_t i = 0; i < 20; ++i) nodes.push_back(&rig.join(i % 2));
  rig.publish_group(1, nodes[0]->id, nodes);
  std::string ids;
  for (const FakeNode* node : nodes) {
    const std::uint32_t id = node->id.value();
    ids.append(reinterpret_cast<const char*>(&id), sizeof id);
  }
  for (int i = 0; i < 20; ++i) {
    add(*nodes[0], HubRig::group(1), "group", {.kind = proto::Kind::group});
    add(*nodes[0], 0xFFFFFFFF, "broadcast", {.kind = proto::Kind::broadcast});
    add(*nodes[0], 20, ids + "list", {.kind = proto::Kind::list});
  }
  add(*nodes[0], 20, ids + std::string(30'000, 'l'), {.kind = proto::Kind::list});
  run(50'000);
}

}  // namespace
}  // namespace gimnet::hub
