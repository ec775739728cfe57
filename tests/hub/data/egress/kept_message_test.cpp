#include "hub/data/egress/kept_message.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "tests/hub/data/support/egress_rig.hpp"

namespace gimnet::hub {
namespace {

using testing::EgressRig;

std::string bytes_of(const KeptMessage& message) {
  std::string all;
  message.for_each(
      [&](const hub::Run& run) { all.append(reinterpret_cast<const char*>(run.bytes), run.size); });
  return all;
}

TEST(KeptMessage, KeepsSmallFramesInMemoryOfItsOwn) {
  EgressRig rig;
  KeptMessage message;
  const hub::Run run = rig.run({"hello"});
  message.append(run, false, rig.lease, rig.context);
  EXPECT_EQ(message.frames(), 1u);
  EXPECT_EQ(message.bytes(), run.size);
  message.for_each([&](const hub::Run& piece) { EXPECT_NE(piece.buffer.get(), run.buffer.get()); });
  EXPECT_EQ(bytes_of(message), std::string(reinterpret_cast<const char*>(run.bytes), run.size));
  EXPECT_EQ(rig.pool.pinned_bytes(), 256u);
  message.clear();
  EXPECT_TRUE(message.empty());
  EXPECT_EQ(rig.pool.pinned_bytes(), 0u) << "what is not kept is not charged";
}

TEST(KeptMessage, RefersToWhatIsLargeOrSharedAnyway) {
  EgressRig rig;
  KeptMessage large;
  const hub::Run run = rig.run({std::string(16 * 1024, 'x')});
  large.append(run, false, rig.lease, rig.context);
  large.for_each([&](const hub::Run& piece) { EXPECT_EQ(piece.bytes, run.bytes); });
  KeptMessage shared;
  const hub::Run small = rig.run({"small"});
  shared.append(small, true, rig.lease, rig.context);
  shared.for_each([&](const hub::Run& piece) { EXPECT_EQ(piece.bytes, small.bytes); });
  EXPECT_GT(rig.pool.pinned_bytes(), kSlabReadBytes);
}

TEST(KeptMessage, CopiesIntoMemoryOfItsOwnThatDoesNotCount) {
  EgressRig rig;
  KeptMessage message;
  const hub::Run run = rig.run({std::string(20'000, 'x')});
  message.begin_copy(run.size, rig.context);
  message.append_copy(run, rig.context);
  const std::byte* memory = nullptr;
  message.for_each([&](const hub::Run& piece) {
    EXPECT_NE(piece.buffer.get(), run.buffer.get());
    memory = piece.bytes;
  });
  EXPECT_EQ(bytes_of(message), std::string(reinterpret_cast<const char*>(run.bytes), run.size));
  EXPECT_EQ(rig.pool.pinned_bytes(), 0u);
  message.begin_copy(run.size - 1'000, rig.context);
  EXPECT_TRUE(message.empty());
  const hub::Run next = rig.run({std::string(18'000, 'y'), "more than was said"});
  message.append_copy(next, rig.context);
  message.for_each([&](const hub::Run& piece) { EXPECT_EQ(piece.bytes, memory) << "used again"; });
  message.append_copy(run, rig.context);
  EXPECT_EQ(message.bytes(), next.size + run.size) << "there is room for what was not foreseen";
  message.clear();
  EXPECT_TRUE(message.empty());
}

TEST(KeptMessage, KeepsLittleMemoryOfItsOwnForALaterOne) {
  EgressRig rig;
  KeptMessage message;
  const auto keep = [&](std::size_t size) {
    const hub::Run run = rig.run({std::string(size, 'x')});
    message.begin_copy(run.size, rig.context);
    message.append_copy(run, rig.context);
    std::uint32_t capacity = 0;
    message.for_each([&](const hub::Run& piece) { capacity = piece.buffer->capacity; });
    return capacity - static_cast<std::uint32_t>(proto::kHeaderSize);
  };
  constexpr std::uint32_t kRoom = 4'096 - proto::kHeaderSize;
  EXPECT_EQ(keep(10), 10u);
  EXPECT_EQ(keep(kRoom), kRoom);
  EXPECT_EQ(keep(10), kRoom);
  EXPECT_EQ(keep(kRoom + 1), kRoom + 1);
  EXPECT_EQ(keep(10), 10u);
  EXPECT_EQ(keep(80'000), 80'000u);
  EXPECT_EQ(keep(70'000), 80'000u) << "an eighth may be too much";
  EXPECT_EQ(keep(69'000), 69'000u);
}

TEST(KeptMessage, PutsTheFramesOfAMessageBehindEachOther) {
  EgressRig rig;
  KeptMessage message;
  std::string wanted;
  for (int i = 0; i < 10; ++i) {
    const hub::Run run = rig.run({std::string(3'000, static_cast<char>('a' + i))});
    wanted.append(reinterpret_cast<const char*>(run.bytes), run.size);
    message.append(run, false, rig.lease, rig.context);
  }
  EXPECT_EQ(message.frames(), 10u);
  EXPECT_EQ(bytes_of(message), wanted);
  std::size_t pieces = 0;
  message.for_each([&](const hub::Run&) { ++pieces; });
  EXPECT_LT(pieces, 10u);
}

}  // namespace
}  // namespace gimnet::hub
