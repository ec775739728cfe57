#include "proto/control/route_names.hpp"

#include <gtest/gtest.h>

#include "proto/control/names.hpp"
#include "tests/proto/control/support/ns_vectors.hpp"

namespace gimnet::proto::route {
namespace {

constexpr HubId kHub{7};

NameClaim claim_of(std::uint64_t version, std::uint32_t index) {
  NameClaim claim;
  claim.version = version;
  claim.node = make_id<NodeId>(kHub, index);
  return claim;
}

ServiceClaim service_of_the_vector() {
  ServiceClaim service;
  service.group = make_id<GroupId>(kHub, 33);
  service.session = 3;
  service.message_type = 1;
  service.window = 4;
  service.delivery = ns::Delivery::sync;
  service.retain = true;
  return service;
}

Names names_of_the_vector() {
  Names names{kHub, HubInstance{0x1122334455667788}, 4, 9, 2, {}};
  names.records.push_back({"robot/old", {5, NodeId{}, kOrdinaryRank, NameState::deleted, {}}});
  names.records.push_back({"robot", claim_of(7, 17)});
  names.records.back().claim.rank = 2;
  names.records.back().claim.state = NameState::away;
  names.records.push_back({"robot/laser", claim_of(9, 17)});
  names.records.back().claim.service = service_of_the_vector();
  return names;
}

Result<Names> again(const Names& names) { return decode<Names>(encode(names)); }

TEST(RouteNames, AreDecodedAndWrittenAsTheVectorsSay) {
  test::expect_request(
      "route/names_known", 0,
      NamesKnown{{{HubId{2}, HubInstance{0x22}, 40}, {HubId{9}, HubInstance{0x99}, 0}}});
  test::expect_request("route/names", 0, names_of_the_vector());
  test::expect_request("route/names_taken", 0, NamesTaken{2});
}

TEST(RouteNames, StandForOneHubAlone) {
  Names names = names_of_the_vector();
  names.hub = HubId{8};
  EXPECT_FALSE(again(names));
  names = names_of_the_vector();
  names.records.back().claim.service->group = make_id<GroupId>(HubId{8}, 1);
  EXPECT_FALSE(again(names));
  names.hub = HubId{4095};
  EXPECT_FALSE(again(names));
}

TEST(RouteNames, AscendWithinTheirRange) {
  Names names = names_of_the_vector();
  names.after = 5;
  EXPECT_FALSE(again(names)) << "the first one is not behind it";
  names = names_of_the_vector();
  names.version = 8;
  EXPECT_FALSE(again(names)) << "the last one is behind it";
  names = names_of_the_vector();
  std::swap(names.records[0], names.records[1]);
  EXPECT_FALSE(again(names));
  names.records.clear();
  EXPECT_TRUE(again(names));
}

TEST(RouteNames, AreNamesAndStatesThatThereAre) {
  Names names = names_of_the_vector();
  names.records[1].name = "no//name";
  EXPECT_FALSE(again(names));
  names = names_of_the_vector();
  names.records[1].claim.state = static_cast<NameState>(3);
  EXPECT_FALSE(again(names));
}

TEST(RouteNames, HaveRecordsOfBoundedSize) {
  Names names{kHub, HubInstance{~0ull}, 0, ~0ull, ~0ull, {}};
  const std::size_t head = encode(names).size();
  names.records.push_back({std::string(kNameBytesMax, 'n'), claim_of(~0ull, 0xfffff)});
  names.records.back().claim.rank = ~0u;
  names.records.back().claim.state = NameState::away;
  ServiceClaim service = service_of_the_vector();
  service.session = ~0ull;
  names.records.back().claim.service = service;
  EXPECT_LE(encode(names).size() - head, kNameRecordBytesMax);
  EXPECT_EQ(*again(names), names);
}

TEST(RouteNames, KnownAreAtMostSoManyHubs) {
  NamesKnown known;
  for (std::uint16_t hub = 1; hub <= kNamesKnownMax; ++hub)
    known.hubs.push_back({HubId{hub}, HubInstance{hub}, hub});
  const auto bytes = encode(known);
  EXPECT_LE(bytes.size(), kNamesBytesMax);
  EXPECT_EQ(*decode<NamesKnown>(bytes), known);
  known.hubs.resize(1);
  known.hubs.front().hub = HubId{0};
  EXPECT_FALSE(decode<NamesKnown>(encode(known)));
  bitestream::Writer body;
  body.put_opaque(1, std::vector<std::byte>(17, std::byte{1}));
  EXPECT_FALSE(decode<NamesKnown>(assemble_control({NamesKnown::kOperation, 0}, body)));
}

}  // namespace
}  // namespace gimnet::proto::route
