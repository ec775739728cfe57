#include "hub/control/state/records.hpp"

#include <gtest/gtest.h>

namespace gimnet::hub {
namespace {

using namespace std::chrono_literals;
namespace ns = proto::ns;

TEST(Records, TellAllThatIsKnown) {
  const Limits limits;
  Membership membership(Sessions::Options{HubId{7}, 1, Placement::spread}, limits);
  const HubTitle title{HubId{7}, "lab"};
  JoinRequest request;
  request.name = "robot";
  request.description = "forklift";
  request.origin = PeerAddress{"tcp", "127.0.0.1:1"};
  Effects effects;
  const Session& session = *membership.join(request, 1s, effects)->session;
  ServiceTerms terms;
  terms.message_type = 3;
  terms.instance = 4;
  terms.direction = proto::ns::Direction::accepts;
  terms.metadata = "x y";
  const auto service =
      membership.services().advertise(session.index, "robot/odom", terms, 1s, effects);
  ASSERT_TRUE(service);
  ASSERT_TRUE(membership.services().subscribe(session.index, "robot/odom", {}, effects));

  ns::NodeRecord node;
  node.node = make_id(HubId{7}, session.index);
  node.name = "robot";
  node.hub = HubId{7};
  node.hub_name = "lab";
  node.connected = true;
  node.description = "forklift";
  node.place = "127.0.0.1:1";
  node.joined_ms = 2'000;
  node.services = 1;
  EXPECT_EQ(record_of(title, session, membership.services(), 3s), node);

  const ns::ServiceRecord record =
      record_of(title, *membership.topics().find_group(service->group));
  EXPECT_EQ(record.group, make_id(HubId{7}, service->group));
  EXPECT_EQ(record.name, "robot/odom");
  EXPECT_EQ(record.node, node.node);
  EXPECT_EQ(record.message_type, 3u);
  EXPECT_EQ(record.instance, 4u);
  EXPECT_EQ(record.direction, ns::Direction::accepts);
  EXPECT_EQ(record.metadata, "x y");
  EXPECT_EQ(record.subscribers, 1u);
  EXPECT_EQ(record.hub_name, "lab");
}

}  // namespace
}  // namespace gimnet::hub
