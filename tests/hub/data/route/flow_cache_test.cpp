#include "hub/data/route/flow_cache.hpp"

#include <gtest/gtest.h>

#include "tests/hub/data/support/route_rig.hpp"

namespace gimnet::hub {
namespace {

using testing::RouteRig;
using testing::TestFrame;

constexpr std::uint32_t kHub = 7u << 20;

struct Frame {
  std::uint32_t index = 0;  ///< of the node that it is for
  std::string payload;
  TestFrame how = {};
};

class FlowCacheTest : public ::testing::Test {
 protected:
  void TearDown() override { EXPECT_TRUE(rig.ledger_exact()); }

  /// Neighbouring frames, as a read leaves them.
  std::vector<std::byte> bytes_of(const std::vector<Frame>& frames) {
    std::vector<std::byte> bytes;
    for (const Frame& frame : frames) {
      const hub::Run run = rig.make_run(kHub | frame.index, {frame.payload}, frame.how);
      bytes.insert(bytes.end(), run.bytes, run.bytes + run.size);
      rig.egress.accepted -= run.frames;  // counted where they are handed on
    }
    return bytes;
  }
  /// One frame the long way.
  void route(const Frame& frame) {
    rig.route(rig.make_run(kHub | frame.index, {frame.payload}, frame.how));
  }
  /// As if it had got such frames from the same bytes already.
  void note(std::uint32_t index, const TestFrame& how = {}) {
    route({index, "first", how});
    route({index, "second", how});
  }
  proto::RunView append(const std::vector<std::byte>& bytes) {
    const auto appended = rig.router.append_repeats(bytes.data(), bytes.data() + bytes.size());
    rig.egress.accepted += appended.frames;
    return appended;
  }
  std::uint32_t appended(const std::vector<Frame>& frames) {
    return append(bytes_of(frames)).frames;
  }

  RouteRig rig;
  Recipient& a = rig.add_here(2);
  Recipient& b = rig.add_here(3);
};

TEST_F(FlowCacheTest, FramesInTurnsGoBehindTheOnesBefore) {
  note(2);
  note(3);
  const auto bytes = bytes_of({{2, "x"}, {3, "yy"}, {2, ""}, {3, "zzz"}});
  const auto taken = append(bytes);
  EXPECT_EQ(taken.frames, 4u);
  EXPECT_EQ(taken.size, bytes.size());
  EXPECT_EQ(a.outbox.lane(1).front().frames, 4u);
  EXPECT_EQ(b.outbox.lane(1).front().frames, 4u);
  EXPECT_EQ(rig.egress.tally.queued, 8);
  const hub::Run& run = a.outbox.lane(1).front().run;
  const std::string behind(reinterpret_cast<const char*>(run.bytes) + run.size - 33, 33);
  EXPECT_EQ(behind.substr(16, 1), "x");
}

TEST_F(FlowCacheTest, NobodyIsKnownInBytesOfAnotherConnection) {
  rig.router.begin_bytes(NodeId{kHub | 1});
  note(2);
  rig.router.begin_bytes(NodeId{kHub | 1});
  EXPECT_EQ(appended({{2, "x"}}), 1u);
  rig.router.begin_bytes(NodeId{kHub | 9});
  EXPECT_EQ(appended({{2, "x"}}), 0u);
}

TEST_F(FlowCacheTest, NobodyIsKnownAfterTheTableChanged) {
  note(2);
  rig.nodes.publish(30, {});
  rig.router.begin_bytes(NodeId{});
  EXPECT_EQ(appended({{2, "x"}}), 0u);
}

TEST_F(FlowCacheTest, NobodyIsKnownAfterARecipientWent) {
  note(2);
  rig.router.forget_flows();
  EXPECT_EQ(appended({{2, "x"}}), 0u);
}

// The outbox has taken frames of the other one just before.
TEST_F(FlowCacheTest, OfAConnectionOnlyItsOwnFramesAreTaken) {
  rig.router.begin_bytes(NodeId{kHub | 1});
  note(2);
  rig.router.begin_bytes(NodeId{kHub | 9});
  a.frame_bytes = Outbox::kAppendBytesMax;
  route({2, std::string(a.frame_bytes + 1, 'x'), {.src = 9}});
  EXPECT_EQ(rig.egress.dropped(proto::DropReason::too_large), 1u);
  EXPECT_EQ(appended({{2, "x", {.src = 1}}}), 0u);
}

TEST_F(FlowCacheTest, FramesForOneNodeInARowAreLeftToFormARun) {
  note(2);
  note(3);
  EXPECT_EQ(appended({{2, "x"}, {2, "y"}, {3, "z"}}), 1u);
}

TEST_F(FlowCacheTest, WhoHasTheSamePlaceIsNotMistaken) {
  rig.add_here(2 + 32);
  note(2);
  EXPECT_EQ(appended({{2 + 32, "for another node"}}), 0u);
}

TEST_F(FlowCacheTest, AFrameThatIsNotWholeIsLeft) {
  note(2);
  auto bytes = bytes_of({{2, "x"}});
  bytes.pop_back();
  EXPECT_EQ(append(bytes).frames, 0u);
  bytes.resize(proto::kHeaderSize - 1);
  EXPECT_EQ(append(bytes).frames, 0u);
  auto endless = bytes_of({{2, "x"}});
  store_le(endless.data(), ~std::uint32_t{0});
  EXPECT_EQ(append(endless).frames, 0u);
}

TEST_F(FlowCacheTest, OtherHeadersAreLookedAt) {
  note(2);
  EXPECT_EQ(appended({{2, "x", {.lane = 2}}}), 0u);
  EXPECT_EQ(appended({{2, "x", {.flags = proto::kFlagReport}}}), 0u);
  EXPECT_EQ(appended({{2, "x", {.kind = proto::Kind::service}}}), 0u);
  EXPECT_EQ(appended({{2, "of somebody else", {.src = 9}}}), 0u);
  EXPECT_EQ(appended({{2, "x"}}), 1u);
}

TEST_F(FlowCacheTest, EachNodeHasASortOfItsOwn) {
  note(2);
  note(3, {.lane = 2});
  EXPECT_EQ(appended({{2, "x"}, {3, "x", {.lane = 2}}, {2, "x"}}), 3u);
}

TEST_F(FlowCacheTest, WhatTheGateCountsOrReadsIsNeverNoted) {
  note(2, {.lane = 0});
  EXPECT_EQ(appended({{2, "x", {.lane = 0}}}), 0u);
  note(3, {.flags = proto::kFlagKeyed});
  EXPECT_EQ(appended({{3, "not 8 bytes", {.flags = proto::kFlagKeyed}}}), 0u);
}

TEST_F(FlowCacheTest, WhoTakesOnlySmallFramesIsAsked) {
  a.frame_bytes = Outbox::kAppendBytesMax - 1;
  b.frame_bytes = Outbox::kAppendBytesMax;
  note(2);
  EXPECT_EQ(appended({{2, "x"}}), 0u);
  note(3);
  EXPECT_EQ(appended({{3, "x"}}), 1u);
}

TEST_F(FlowCacheTest, FromTheSizeOnThatIsCheaperToReferenceNothingIsAppended) {
  note(2);
  const std::string most(Outbox::kAppendBytesMax - proto::kHeaderSize - 1, 'x');
  for (int i = 0; i < 8; ++i)
    route({2, most});  // until there is a chunk with room for more of them
  EXPECT_EQ(appended({{2, most}}), 1u);
  EXPECT_EQ(appended({{2, most + "x"}}), 0u);
}

}  // namespace
}  // namespace gimnet::hub
