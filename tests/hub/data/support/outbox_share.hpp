#pragma once

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <string>
#include <utility>
#include <vector>

#include "hub/data/egress/outbox.hpp"
#include "tests/hub/data/support/egress_rig.hpp"

namespace gimnet::hub::testing {

inline constexpr std::uint8_t kBlock = 1;
inline constexpr std::uint8_t kDrop = 2;
inline constexpr std::uint32_t kKiB = 1024;

/// Group frames are dropped from the oldest on.
inline constexpr TestFrame kOldest{.kind = proto::Kind::group};

inline Limits limits_of_the_test() {
  Limits limits;
  limits.budget_bytes = 12 << 20;
  return limits;
}

/// A payload that makes a frame of exactly `size` bytes.
inline std::string sized(std::uint64_t size, char fill = 'x') {
  return std::string(size - proto::kHeaderSize, fill);
}

/// A connection while memory is scarce, beside others for which data waits.
class OutboxShare : public ::testing::Test {
 protected:
  OutboxShare() {
    // 2 MiB by 64 connections; the one of the test is another one.
    for (int i = 0; i < kOthers; ++i) rig.lease.begin_waiting();
  }
  ~OutboxShare() override {
    rig.lease.give_back(taken_);
    for (int i = 0; i < kOthers; ++i) rig.lease.end_waiting();
  }
  void TearDown() override { EXPECT_TRUE(rig.ledger_exact()); }

  /// The connection takes nothing, and something waits for it. Memory becomes scarce.
  void block(std::uint8_t lane = 3) {
    connection.peer.set_room(0);
    rig.push(connection.outbox, "first", {.kind = proto::Kind::group, .lane = lane});
    EXPECT_EQ(connection.flush(), Flush::blocked);
    make_scarce();
  }
  void make_scarce(std::uint64_t taken = kTaken) {
    rig.lease.take(taken_ = taken);
    rig.lease.begin_turn(0);
    ASSERT_TRUE(rig.lease.scarce());
    share = rig.lease.share_bytes();
  }
  void end_scarce() {
    rig.lease.give_back(std::exchange(taken_, 0));
    rig.lease.begin_turn(0);
    ASSERT_FALSE(rig.lease.scarce());
  }
  /// The bytes for which the share has room yet.
  std::uint64_t room() { return share - connection.outbox.held_bytes(); }
  std::vector<std::string> starts() {
    connection.peer.set_room(MemoryPeer::kAll);
    std::vector<std::string> texts;
    while (connection.flush() != Flush::emptied) {
    }
    for (const std::string& each : connection.take()) texts.push_back(each.substr(0, 1));
    return texts;
  }

  static constexpr int kOthers = 63;
  static constexpr std::uint64_t kTaken = 11 << 20;     ///< less than a sixth is free
  static constexpr std::uint64_t kWithSpare = 9 << 20;  ///< a quarter is free
  std::uint64_t looks_ = 0;
  std::uint64_t taken_ = 0;
  std::uint64_t share = 0;  ///< 32 KiB
  EgressRig rig{limits_of_the_test()};
  TestConnection connection{rig};
};

}  // namespace gimnet::hub::testing
