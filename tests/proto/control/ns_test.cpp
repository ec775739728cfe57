#include "proto/control/ns.hpp"

#include <gtest/gtest.h>

#include <string>
#include <vector>

#include "proto/control/names.hpp"
#include "tests/proto/control/support/ns_vectors.hpp"

namespace gimnet::proto::ns {
namespace {

using test::expect_answer;
using test::expect_request;

constexpr NodeId kNode{0x00700012};
constexpr NodeId kProvider{0x00700011};
constexpr GroupId kGroup{0x00700005};

/// 7#5 while `provider` provides it in its third session.
ServiceState state(NodeId provider) {
  ServiceState state;
  state.group = kGroup;
  state.provider = provider;
  state.session = 3;
  state.message_type = 3;
  return state;
}

TEST(NsMessages, AreDecodedAndWrittenAsTheVectorsSay) {
  expect_request("ns/resolve", 1, Resolve{"robot/base"});
  expect_answer("ns/resolve_answer", 1, ResolveAnswer{kNode});
  expect_request("ns/reverse", 2, Reverse{kNode});
  expect_answer("ns/reverse_answer", 2, ReverseAnswer{"robot/base", kNode});
  expect_request("ns/list", 3, List{"robot/**", NodeId{0x00700011}, 2});
  expect_request("ns/advertise", 4,
                 Advertise{"odom", 3, 1, Direction::provides, Delivery::latest, "x y theta"});
  expect_answer("ns/advertise_answer", 4, AdvertiseAnswer{kGroup, 2});
  expect_request("ns/withdraw", 5, Withdraw{kGroup});
  expect_answer("ns/withdraw_answer", 5, WithdrawAnswer{});
  expect_request("ns/services", 6, ServicesRequest{});
  ServicesRequest missed;
  missed.pattern = "robot/*";
  missed.missed = true;
  EXPECT_EQ(*decode<ServicesRequest>(encode(missed, 6)), missed);
  expect_request("ns/subscribe", 7, Subscribe{"robot/odom"});
  SubscribeAnswer answer{state(kNode)};
  answer.instance = 1;
  answer.delivery = Delivery::latest;
  expect_answer("ns/subscribe_answer", 7, answer);
  Advertise offer;
  offer.service = "map";
  offer.message_type = 3;
  offer.delivery = Delivery::sync;
  offer.window = 2;
  offer.retain = true;
  expect_request("ns/advertise_sync", 12, offer);
  expect_request("ns/subscribe_paced", 13, Subscribe{"robot/map", 1, 3, 2.5, 2});
  SubscribeAnswer paced{state(kProvider), 2};
  paced.delivery = Delivery::sync;
  paced.window = 1;
  paced.retain = true;
  expect_answer("ns/subscribe_paced_answer", 13, paced);
  SubscribeAnswer accepting{state(kProvider)};
  accepting.direction = Direction::accepts;
  expect_answer("ns/subscribe_accepting_answer", 14, accepting);
  expect_request("ns/unsubscribe", 8, Unsubscribe{"robot/odom"});
  expect_answer("ns/unsubscribe_answer", 8, UnsubscribeAnswer{});
}

TEST(NsMessages, ListRecordsAsTheVectorsSay) {
  ListAnswer list;
  list.nodes = {{kNode, "robot/base", HubId{7}, "lab", true, "a robot", "127.0.0.1:40000", 1500, 2},
                {NodeId{0x00700013}, "robot/laser", HubId{7}, "lab", false, "a robot",
                 "127.0.0.1:40000", 1500, 2}};
  list.more = true;
  list.next = NodeId{0x00700013};
  expect_answer("ns/list_answer", 3, list);

  ServicesAnswer services;
  services.services = {{kGroup,
                        "robot/odom",
                        NodeId{0x00700011},
                        3,
                        1,
                        Direction::provides,
                        Delivery::latest,
                        "x y theta",
                        2,
                        "lab",
                        0,
                        false,
                        0,
                        {}}};
  expect_answer("ns/services_answer", 6, services);
}

TEST(NsMessages, EventsAreAsTheVectorsSay) {
  ServiceMoved moved{state(kNode), "robot/odom"};
  moved.instance = 1;
  moved.delivery = Delivery::latest;
  expect_request("ns/service_moved", 0, moved);
  moved.provider = NodeId{};
  moved.session = 0;
  expect_request("ns/service_moved_nobody", 0, moved);
  ServiceMoved accepting{state(kNode), "robot/cmd"};
  accepting.group = GroupId{0x00700006};
  accepting.direction = Direction::accepts;
  expect_request("ns/service_moved_accepting", 0, accepting);
  accepting.away = true;
  expect_request("ns/service_moved_away", 0, accepting);
  expect_request("ns/subscribers", 0, Subscribers{kGroup, 2});
}

TEST(NsMessages, BoundNames) {
  bitestream::Writer longest;
  longest.put_text(3, std::string(kNameBytesMax, 'a'));
  EXPECT_TRUE(decode<Resolve>(assemble_control({Resolve::kOperation, 1}, longest)));
  bitestream::Writer longer;
  longer.put_text(3, std::string(kNameBytesMax + 1, 'a'));
  EXPECT_FALSE(decode<Resolve>(assemble_control({Resolve::kOperation, 1}, longer)));
}

TEST(NsMessages, RefuseAChoiceThatAHubDoesNotKnow) {
  bitestream::Writer body;
  body.put_text(3, "odom");
  body.put_u8(7, 3);
  const auto advertise = decode<Advertise>(assemble_control({Advertise::kOperation, 1}, body));
  ASSERT_FALSE(advertise);
  EXPECT_EQ(advertise.error().sentence, "ADVERTISE has an unknown delivery");
}

TEST(NsMessages, NeedWhatTheyAreAbout) {
  EXPECT_FALSE(decode<Resolve>(test::from_hex("03 00 01 00")));
  EXPECT_FALSE(decode<Reverse>(test::from_hex("04 00 01 00")));
  EXPECT_FALSE(decode<Advertise>(test::from_hex("07 00 01 00")));
  EXPECT_FALSE(decode<Withdraw>(test::from_hex("08 00 01 00")));
  EXPECT_FALSE(decode<Subscribe>(test::from_hex("0a 00 01 00")));
  EXPECT_TRUE(decode<List>(test::from_hex("05 00 01 00"))) << "LIST has a default for everything";
}

TEST(NsMessages, RecordsFitInTheBytesThatArePlannedForThem) {
  const auto size_of = [](const auto& answer) { return encode_answer(answer, 1).size(); };
  NodeRecord node;
  node.node = NodeId{UINT32_MAX};
  node.name.assign(kNameBytesMax, 'n');
  node.hub_name.assign(kNameBytesMax, 'h');
  node.description.assign(kDescriptionBytesMax, 'd');
  node.place.assign(kRemarkBytesMax, 'p');
  EXPECT_LE(size_of(ListAnswer{{node}, false, {}}) - size_of(ListAnswer{}), page_bytes_max(node));
  ServiceRecord service;
  service.name.assign(kNameBytesMax, 'n');
  service.metadata.assign(kMetadataBytesMax, 'm');
  service.hub_name.assign(kNameBytesMax, 'h');
  service.missed = UINT64_MAX;
  service.missed_most = NodeId{UINT32_MAX};
  EXPECT_LE(size_of(ServicesAnswer{{service}, false, {}}) - size_of(ServicesAnswer{}),
            page_bytes_max(service));
}

}  // namespace
}  // namespace gimnet::proto::ns
