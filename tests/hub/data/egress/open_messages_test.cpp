#include "hub/data/egress/open_messages.hpp"

#include <gtest/gtest.h>

#include "hub/data/egress/outbox.hpp"
#include "tests/hub/data/support/egress_rig.hpp"

namespace gimnet::hub {
namespace {

using proto::DropReason;
using proto::Kind;
using testing::EgressRig;
using testing::TestConnection;
using testing::TestFrame;

TEST(OpenMessages, ABeginningEndsTheMessageBeforeItInItsStream) {
  EgressRig rig;
  TestConnection connection(rig);
  const auto begin = [&](std::uint32_t number, TestFrame frame) {
    rig.push_fragment(connection.outbox, number, 0, 20, std::string(10, 'a'), frame);
  };
  const auto end = [&](std::uint32_t number, TestFrame frame) {
    rig.push_fragment(connection.outbox, number, 10, 20, std::string(10, 'a'), frame);
    return rig.dropped(DropReason::cut_message);
  };
  begin(1, {.src = 2});
  begin(2, {.lane = 2, .src = 2});
  begin(3, {.kind = Kind::group, .src = 2});
  begin(4, {.kind = Kind::group, .src = 2, .dst = 7});
  begin(5, {.src = 3});
  begin(6, {.src = 2});
  EXPECT_EQ(end(1, {.src = 2}), 1u) << "its stream went on";
  EXPECT_EQ(end(2, {.lane = 2, .src = 2}), 1u);
  EXPECT_EQ(end(3, {.kind = Kind::group, .src = 2}), 1u);
  EXPECT_EQ(end(4, {.kind = Kind::group, .src = 2, .dst = 7}), 1u);
  EXPECT_EQ(end(5, {.src = 3}), 1u);
  rig.push_fragment(connection.outbox, 7, 0, 10, std::string(10, 'a'), {.src = 2});
  EXPECT_EQ(end(6, {.src = 2}), 2u) << "a message of one fragment ends it, too";
  EXPECT_TRUE(rig.ledger_exact());
}

TEST(OpenMessages, ASenderOfBeginningsLosesNoMessageOfOthers) {
  for (const std::uint32_t begun : {255u, 256u}) {
    EgressRig rig;
    TestConnection connection(rig);
    rig.push_fragment(connection.outbox, 1, 0, 20, std::string(10, 'a'));
    const auto fragment = [&](std::uint32_t number, std::uint32_t offset) {
      rig.push_fragment(connection.outbox, number, offset, 20, std::string(10, 'a'),
                        {.kind = Kind::group, .src = 9, .dst = number});
    };
    for (std::uint32_t number = 1; number <= begun; ++number) fragment(number, 0);
    fragment(2, 10);
    EXPECT_FALSE(rig.tally.any_dropped);
    rig.push_fragment(connection.outbox, 1, 10, 20, std::string(10, 'a'));
    EXPECT_FALSE(rig.tally.any_dropped) << "it came first, and is alone of its source";
    fragment(1, 10);
    EXPECT_EQ(rig.dropped(DropReason::cut_message), begun == 255 ? 0u : 1u) << begun;
    EXPECT_TRUE(rig.ledger_exact());
  }
}

}  // namespace
}  // namespace gimnet::hub
