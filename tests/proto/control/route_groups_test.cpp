#include "proto/control/route_groups.hpp"

#include <gtest/gtest.h>

#include "tests/proto/control/support/ns_vectors.hpp"

namespace gimnet::proto::route {
namespace {

constexpr GroupId kScan = make_id<GroupId>(HubId{2}, 33);
constexpr GroupId kMap = make_id<GroupId>(HubId{2}, 34);

TEST(RouteGroups, AreDecodedAndWrittenAsTheVectorsSay) {
  test::expect_request("route/join", 0, Join{{{kScan, {100'000, 1}}, {kMap, {0, 4, 2}}}, true});
  test::expect_request("route/join_subscribers", 0,
                       Join{{{kScan, {}, 3}, {kMap, {}, 70'000}}, false});
  test::expect_request("route/leave", 0, Leave{{kScan}});
  test::expect_request("route/joins_end", 0, JoinsEnd{});
  test::expect_request("route/joined", 0, Joined{{kMap}});
}

TEST(RouteGroups, HaveOneToAllPlaces) {
  Leave leave;
  leave.groups.assign(kGroupsMax, kScan);
  EXPECT_TRUE(decode<Leave>(encode(leave)));
  for (const std::size_t size : {std::size_t{3}, std::size_t{6}, 4 * (kGroupsMax + 1)}) {
    Payload payload = encode(Leave{{kScan}});
    payload.resize(kControlHeaderSize);
    // key 1, opaque, with a length of two bytes
    for (const int byte :
         {0x01, 0x01, 0x00, 0x00, static_cast<int>(size & 0xFF), static_cast<int>(size >> 8)})
      payload.push_back(static_cast<std::byte>(byte));
    for (std::size_t i = 0; i < size; ++i) payload.push_back(static_cast<std::byte>(i % 4 / 2));
    EXPECT_FALSE(decode<Leave>(payload)) << size;
  }
}

TEST(RouteGroups, JoinForOneSubscriberEachIfNotSaid) {
  const Join ones{{{kScan, {}}, {kMap, {}}}, false};
  Payload payload = encode(ones);
  EXPECT_EQ(*decode<Join>(payload), ones);
  EXPECT_EQ(payload.size(), kControlHeaderSize + 5 + 24) << "as hubs of 0.9.0 write it";
  Join most;
  most.groups.assign(kGroupsMax, {kScan, {}, UINT32_MAX});
  EXPECT_EQ(*decode<Join>(encode(most)), most);
}

TEST(RouteGroups, HaveOneNumberOfSubscribersForEachGroup) {
  const Payload joins = encode(Join{{{kScan, {}}, {kMap, {}}}, false});
  for (const std::size_t size : {0u, 4u, 7u, 9u, 12u, 200u}) {
    Payload payload = joins;
    // key 3, opaque
    for (const int byte : {0x00, 0x03, 0x00, 0x00, static_cast<int>(size)})
      payload.push_back(static_cast<std::byte>(byte));
    payload.resize(payload.size() + size, std::byte{1});
    EXPECT_FALSE(decode<Join>(payload)) << size;
  }
  EXPECT_FALSE(decode<Join>(encode(Join{{{kScan, {}, 2}, {kMap, {}, 0}}, false}))) << "for nobody";
}

TEST(RouteGroups, NameGroupsThatCanBe) {
  for (const GroupId group : {make_id<GroupId>(HubId{0}, 1), make_id<GroupId>(HubId{4095}, 1),
                              make_id<GroupId>(HubId{2}, 0), make_id<GroupId>(HubId{2}, 0xFFFFF)}) {
    EXPECT_FALSE(decode<Joined>(encode(Joined{{group}})));
    EXPECT_FALSE(decode<Join>(encode(Join{{{group, {}}}, false})));
  }
  EXPECT_FALSE(decode<Join>(encode(Join{{{kScan, {0, 0}}}, false}))) << "a depth of 0";
}

}  // namespace
}  // namespace gimnet::proto::route
