#include "hub/control/state/group_proof.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <vector>

#include "proto/control/ns.hpp"

namespace gimnet::hub {
namespace {

using ::testing::ElementsAreArray;

constexpr GroupGrant kGrant{HubId{7}, GroupIndex{5}, "robot1/base/odom", 3};

Secret secret_of(int value) {
  Secret secret{};
  secret.fill(static_cast<std::byte>(value));
  return secret;
}

// By another implementation, from what docs/protocol.md says: a hub that wrote other bytes after an
// update would take their groups from all services.
TEST(GroupProof, IsWhatTheDocumentSays) {
  constexpr std::uint8_t kDue[] = {0x48, 0x9e, 0x85, 0xf2, 0x6b, 0x35, 0xf3, 0x25,
                                   0x37, 0x09, 0x1b, 0xea, 0x2e, 0x1f, 0x33, 0x00};
  std::vector<std::uint8_t> proof;
  for (const std::byte each : write_group_proof(kGrant, secret_of(1)))
    proof.push_back(std::to_integer<std::uint8_t>(each));
  EXPECT_THAT(proof, ElementsAreArray(kDue));
  EXPECT_LE(proof.size(), proto::ns::kGroupProofBytesMax);
}

TEST(GroupProof, IsForItsGroupItsServiceItsHubAndItsTimeOnly) {
  const GroupProof proof = write_group_proof(kGrant, secret_of(1));
  EXPECT_TRUE(proves(proof, kGrant, secret_of(1)));
  EXPECT_FALSE(proves(proof, kGrant, secret_of(2)));
  EXPECT_FALSE(proves(proof, {HubId{8}, GroupIndex{5}, "robot1/base/odom", 3}, secret_of(1)));
  EXPECT_FALSE(proves(proof, {HubId{7}, GroupIndex{6}, "robot1/base/odom", 3}, secret_of(1)));
  EXPECT_FALSE(proves(proof, {HubId{7}, GroupIndex{5}, "robot1/base/odo", 3}, secret_of(1)));
  EXPECT_FALSE(proves(proof, {HubId{7}, GroupIndex{5}, "robot1/base/odom", 4}, secret_of(1)));
}

TEST(GroupProof, OneBitChangedOrAByteMoreOrLessProvesNothing) {
  const GroupProof proof = write_group_proof(kGrant, secret_of(1));
  for (std::size_t bit = 0; bit < proof.size() * 8; ++bit) {
    GroupProof forged = proof;
    forged[bit / 8] ^= static_cast<std::byte>(1u << (bit % 8));
    EXPECT_FALSE(proves(forged, kGrant, secret_of(1))) << "bit " << bit;
  }
  std::vector<std::byte> longer(proof.begin(), proof.end());
  longer.push_back(std::byte{});
  EXPECT_FALSE(proves(longer, kGrant, secret_of(1)));
  EXPECT_FALSE(proves(std::span{proof}.first(15), kGrant, secret_of(1)));
  EXPECT_FALSE(proves({}, kGrant, secret_of(1)));
}

}  // namespace
}  // namespace gimnet::hub
