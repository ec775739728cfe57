#include <gtest/gtest.h>

#include <cstddef>
#include <cstdint>
#include <thread>
#include <vector>

#include "tests/client/nif/support/declaring.hpp"

// What an own service shows to a hub that was killed, to have its group again.

namespace gimnet::nif::test {
namespace {

TEST(FormerGroups, AreClaimedWithTheProofThatCameWithTheGroup) {
  const std::vector<std::byte> first(16, std::byte{1});
  const std::vector<std::byte> second(proto::ns::kGroupProofBytesMax, std::byte{2});
  FakeHub hub;
  Connected connected = connect_to(hub, default_options("robot"), make_welcome(kResumeBytes));
  std::thread asking([&] {
    nif_service service{};
    service.struct_size = sizeof service;
    service.name = "odom";
    std::uint32_t given = 0;
    EXPECT_EQ(nif_advertise(connected.node.get(), &service, &given, nullptr, NIF_FOREVER), NIF_OK);
    EXPECT_EQ(given, 11u);
  });
  expect_claim(connected.hub, 0, {}, {GroupId{11}, 0, first});
  asking.join();
  come_back(hub, connected, false);
  expect_claim(connected.hub, 11, first, {GroupId{12}, 0, second});
  EXPECT_EQ(wait_for_move(connected.node.get()), 12u);
  come_back(hub, connected, false);
  expect_claim(connected.hub, 12, second, {GroupId{13}, 0});
  EXPECT_EQ(wait_for_move(connected.node.get()), 13u);
  come_back(hub, connected, false);
  expect_claim(connected.hub, 13, {}, {GroupId{13}, 0});
}

}  // namespace
}  // namespace gimnet::nif::test
