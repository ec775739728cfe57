#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "base/log.hpp"
#include "proto/control/ctrl.hpp"
#include "tests/hub/control/support/test_conductor.hpp"

// Tests the answers to administrators if the hub cannot write its state.

namespace gimnet::hub {
namespace {

using namespace std::chrono_literals;
using proto::Status;
using ::testing::HasSubstr;
using ::testing::IsEmpty;
using ::testing::SizeIs;
namespace ctrl = proto::ctrl;

constexpr std::uint32_t kGranted = 5'000;     ///< of the block that newcomers get ids of
constexpr std::uint32_t kNobodys = 500'000;   ///< the disk does not know it
constexpr std::uint32_t kOfBefore = 900'000;  ///< handed out before the restart

class FullDisk : public ::testing::Test, protected TestConductor {
 protected:
  FullDisk() : TestConductor(Placement::spread, second_start()) {
    set_log_level(LogLevel::off);
    now = facts().started + std::chrono::milliseconds{limits.grace_ms};
    keep_error = "cannot write the hub's state to /x/state (write): No space left on device";
  }
  ~FullDisk() override { set_log_level(LogLevel::info); }
  static HubStart second_start() {
    HubStart start{{}, {4'097, IndexPool::kBlock}, {4'097, IndexPool::kBlock}};
    start.nodes.used.insert(kOfBefore);
    start.state.boot = 2;
    return start;
  }
  Node join_admin() {
    may_administer = true;
    proto::Hello hello;
    hello.role = proto::Role::admin;
    const Node admin = join(hello);
    may_administer = false;
    return admin;
  }
  auto reassign(std::uint32_t index) {
    return ask<ctrl::ReassignAnswer>(
        admin_, ctrl::Reassign{robot_.id, make_id<NodeId>(kHub, index)}, proto::Kind::ctrl);
  }
  auto kick() {
    return ask<ctrl::KickAnswer>(admin_, ctrl::Kick{robot_.id, ""}, proto::Kind::ctrl);
  }

  const Node admin_ = join_admin();
  const Node robot_ = join("robot");
};

TEST_F(FullDisk, NoIdIsGivenThatTheNextStartCouldGiveToAnother) {
  for (std::size_t i = 0; i < 2; ++i) {
    const auto refused = reassign(kNobodys);
    ASSERT_FALSE(refused);
    EXPECT_EQ(refused.error().status, Status::limit);
    EXPECT_THAT(refused.error().sentence, HasSubstr(keep_error)) << "each time it is tried";
    EXPECT_THAT(kept, SizeIs(i + 1));
  }
  EXPECT_THAT(shards.all<RenumberCommand>(), IsEmpty());
  EXPECT_FALSE(nodes.find(kNobodys).exists());
  EXPECT_EQ(conductor.membership().sessions().find(NodeIndex{kNobodys}), nullptr);
  EXPECT_TRUE(nodes.find(index_of(robot_.id)).exists());
  keep_error.clear();
  ASSERT_TRUE(reassign(kNobodys));
  EXPECT_TRUE(kept.back().nodes_used.contains(kNobodys));
  EXPECT_THAT(kept, SizeIs(3));
  EXPECT_THAT(shards.all<RenumberCommand>(), SizeIs(1));
  EXPECT_TRUE(nodes.find(kNobodys).exists());
}

TEST_F(FullDisk, AnIdThatTheDiskKnowsAsHandedOutIsGiven) {
  ASSERT_TRUE(reassign(kOfBefore));
  EXPECT_THAT(kept, IsEmpty());
}

TEST_F(FullDisk, SoIsOneOfTheBlockThatIsKeptAlready) {
  ASSERT_TRUE(reassign(kGranted));
  EXPECT_THAT(kept, IsEmpty());
}

TEST_F(FullDisk, AKickIsDoneAndSaysThatItMayBeForgotten) {
  const auto answer = kick();
  ASSERT_TRUE(answer);
  EXPECT_THAT(answer->remark, HasSubstr("'robot'"));
  EXPECT_THAT(answer->remark, HasSubstr(keep_error));
  EXPECT_THAT(shards.all<CloseCommand>(), SizeIs(1));
  keep_error.clear();
  now += 1s;
  conductor.tick(now);
  EXPECT_THAT(kept.back().kicked, SizeIs(1)) << "it is tried again";
  EXPECT_EQ(conductor.next_deadline(), std::nullopt);
}

TEST_F(FullDisk, NewcomersAreToldWhatIsWrong) {
  for (std::uint32_t left = IndexPool::kBlock - 2; left > 0; --left)
    ASSERT_FALSE(try_join({})) << left;
  const auto refused = try_join({});
  ASSERT_TRUE(refused);
  EXPECT_EQ(refused->code, proto::GoodbyeCode::hub_full);
  EXPECT_THAT(refused->sentence, HasSubstr("cannot write its state"));
  keep_error.clear();
  now += 1s;
  conductor.tick(now);
  EXPECT_FALSE(try_join({})) << "it is tried again";
}

TEST_F(FullDisk, AKickThatHasNoRoomToBeRememberedSaysSo) {
  keep_error.clear();
  limits.kicked_tokens = 0;
  const auto answer = kick();
  ASSERT_TRUE(answer);
  EXPECT_THAT(answer->remark, HasSubstr("'robot'"));
  EXPECT_THAT(answer->remark, HasSubstr("kicked_tokens is 0"));
}

TEST_F(FullDisk, AKickThatIsKeptSaysNothing) {
  keep_error.clear();
  const auto answer = kick();
  ASSERT_TRUE(answer);
  EXPECT_EQ(answer->remark, "");
  ASSERT_THAT(kept, SizeIs(1)) << "once";
  EXPECT_THAT(kept[0].kicked, SizeIs(1));
}

}  // namespace
}  // namespace gimnet::hub
