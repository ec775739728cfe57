#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "tests/hub/shard/support/hub_rig.hpp"

namespace gimnet::hub {
namespace {

using proto::DropReason;
using ::testing::AllOf;
using ::testing::Contains;
using ::testing::ElementsAre;
using testing::FakeNode;
using testing::HubRig;

// A node that is flooded hears of it, and of whom, before the data behind the gap.
TEST(FullLane, ItsNodeHearsWhatItCostBeforeWhatComesBehindIt) {
  Limits limits;
  limits.lane1_bytes = 20'000;
  HubRig rig(1, limits);
  FakeNode& quiet = rig.join(0);
  FakeNode& flood = rig.join(0);
  FakeNode& reader = rig.join(0);
  rig.publish_group(5, quiet.id, {&reader});
  const auto publish = [&](const std::string& payload) {
    rig.send(quiet, HubRig::group(5), payload, {.kind = proto::Kind::group});
  };
  const auto flood_with = [&](int count) {
    for (int i = 0; i < count; ++i) {
      rig.send(flood, 0xFFFFFFFF, std::string(984, 'f'), {.kind = proto::Kind::broadcast});
    }
    rig.settle_without_reading();
  };
  reader.pipe.set_room(10);
  publish("begun");
  publish("first");
  for (int i = 0; i < 2; ++i) flood_with(15);  // the second run takes the place of the first
  publish("last");
  rig.settle();
  const std::uint64_t lost = rig.counts(reader).dropped;
  EXPECT_GT(lost, 10u);
  EXPECT_EQ(rig.counts(reader).queue_full, lost);
  EXPECT_THAT(reader.flow_of<proto::flow::Dropped>(),
              ElementsAre(proto::flow::Dropped{DropReason::queue_full, flood.id, lost}));
  EXPECT_EQ(reader.kinds[2], proto::Kind::flow) << "behind the frame that was begun";
  EXPECT_THAT(reader.texts(), AllOf(Contains("first"), Contains("last")));
}

}  // namespace
}  // namespace gimnet::hub
