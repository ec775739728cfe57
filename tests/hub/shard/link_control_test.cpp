#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "proto/control/route.hpp"
#include "proto/frame/report.hpp"
#include "tests/hub/shard/support/hub_rig.hpp"

// Control frames and REPORTs that come over links.

namespace gimnet::hub {
namespace {

using proto::Kind;
using testing::FakeNode;
using testing::HubRig;
using ::testing::IsEmpty;
using ::testing::SizeIs;

constexpr HubId kNear{20};
constexpr HubId kFar{30};
/// The smallest payload of a REPORT.
const std::string kReport(proto::kReportSizeMin, '\1');

/// A link over which one ROUTE frame came.
struct RouteFrame {
  explicit RouteFrame(const proto::Payload& payload) {
    FakeNode& link = rig.link(0, kNear);
    const std::string text(reinterpret_cast<const char*>(payload.data()), payload.size());
    rig.send(link, 0, text, {.kind = Kind::route, .src = make_id<NodeId>(kNear, 0).value()});
    rig.settle();
    events = rig.take_events();
    closed = link.goodbye.has_value();
  }
  HubRig rig;
  std::vector<ShardEvent> events;
  bool closed = false;
};

proto::Payload route_payload(std::uint16_t operation, std::size_t size = 4) {
  proto::Payload payload = proto::encode(proto::route::RecordsEnd{});
  payload[0] = static_cast<std::byte>(operation & 0xff);
  payload[1] = static_cast<std::byte>(operation >> 8);
  payload.resize(size);
  return payload;
}

TEST(LinkControl, HandsRouteFramesOfKnownOperationsOn) {
  for (std::uint16_t operation = 0; operation <= 12; ++operation) {
    const bool known = operation >= 1 && operation <= 10;
    const RouteFrame came(route_payload(operation));
    EXPECT_THAT(came.events, SizeIs(known ? 1 : 0)) << operation;
    EXPECT_EQ(came.rig.sum(&ShardCounters::malformed), known ? 0u : 1u) << operation;
    EXPECT_FALSE(came.closed);
  }
}

TEST(LinkControl, DropsARouteFrameThatIsTooLarge) {
  constexpr std::size_t kMost = 16 * 1024;
  const RouteFrame large(route_payload(5, kMost));
  ASSERT_THAT(large.events, SizeIs(1));
  EXPECT_EQ(large.rig.sum(&ShardCounters::malformed), 0u);
  const RouteFrame larger(route_payload(5, kMost + 1));
  ASSERT_THAT(larger.events, SizeIs(1)) << "the log is told";
  EXPECT_THAT(std::get<ControlFrameEvent>(larger.events[0].what).frame, SizeIs(proto::kHeaderSize));
  EXPECT_EQ(larger.rig.sum(&ShardCounters::malformed), 1u);
  EXPECT_FALSE(larger.closed);
}

TEST(LinkControl, CountsAReportForALinkThatBroke) {
  HubRig rig;
  FakeNode& near = rig.link(0, kNear);
  FakeNode& far = rig.link(0, kFar);
  rig.command(0, CloseCommand{far.session, proto::GoodbyeCode::silent, ""});
  rig.settle();
  const std::uint32_t src = make_id<NodeId>(kNear, kHubIndex).value();
  rig.send(near, make_id<NodeId>(kFar, 5).value(), kReport, {.kind = Kind::report, .src = src});
  rig.settle();
  EXPECT_EQ(rig.sum(&ShardCounters::reports_lost), 1u);
}

TEST(LinkControl, CountsReportsThatWaitForALinkThatBreaks) {
  HubRig rig;
  FakeNode& near = rig.link(0, kNear);
  FakeNode& far = rig.link(0, kFar);
  far.pipe.set_room(0);
  const std::uint32_t src = make_id<NodeId>(kNear, kHubIndex).value();
  for (int i = 0; i < 3; ++i)
    rig.send(near, make_id<NodeId>(kFar, 5).value(), kReport, {.kind = Kind::report, .src = src});
  rig.settle_without_reading();
  EXPECT_EQ(rig.sum(&ShardCounters::reports_lost), 0u);
  far.pipe.reset();
  rig.settle_without_reading();
  EXPECT_EQ(rig.sum(&ShardCounters::reports_lost), 3u);
}

// After a break a hub tells a sender of `link_lost` and `link_unsure` in one write.
TEST(LinkControl, PassesOnReportsOfTheSameHeaderThatComeTogether) {
  HubRig rig;
  FakeNode& near = rig.link(0, kNear);
  FakeNode& far = rig.link(0, kFar);
  const std::uint32_t src = make_id<NodeId>(kNear, kHubIndex).value();
  for (int i = 0; i < 3; ++i)
    rig.send(near, make_id<NodeId>(kFar, 5).value(), kReport, {.kind = Kind::report, .src = src});
  rig.settle();
  EXPECT_EQ(std::ranges::count(far.kinds, Kind::report), 3);
}

}  // namespace
}  // namespace gimnet::hub
