#include "hub/control/dispatch.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <set>

#include "base/log.hpp"
#include "hub/control/handle/admin.hpp"
#include "hub/control/handle/administer.hpp"
#include "hub/control/handle/names.hpp"
#include "proto/control/ctrl_network.hpp"
#include "proto/control/ns.hpp"
#include "tests/hub/control/support/test_conductor.hpp"

namespace gimnet::hub {
namespace {

using proto::Kind;
using proto::Role;

TEST(Dispatch, FindsHandlersByKindAndOperation) {
  EXPECT_EQ(handler_for(Role::node, Kind::ns, proto::ns::Resolve::kOperation), &handle_resolve);
  EXPECT_EQ(handler_for(Role::admin, Kind::ctrl, proto::ctrl::HubInfo::kOperation),
            &handle_hub_info);
  EXPECT_NE(handler_for(Role::node, Kind::ctrl, proto::ns::Resolve::kOperation), &handle_resolve);
}

TEST(Dispatch, EveryUnknownOperationIsAnsweredNotSupported) {
  set_log_level(LogLevel::off);
  TestConductor hub;
  const TestConductor::Node robot = hub.join("robot");
  for (const Kind kind : {Kind::ns, Kind::ctrl}) {
    for (const int number : {0, 1'000, 0x8003, 0xffff}) {
      const auto operation = static_cast<std::uint16_t>(number);
      hub.send_frame(robot, kind, proto::assemble_control({operation, 9}, {}));
      const auto& answer = std::get<SendControlCommand>(hub.shards.sent.back().command);
      const auto view = proto::split_control(TestConductor::payload_of(answer));
      EXPECT_EQ(view->header.operation, operation | proto::kAnswerBit);
      EXPECT_EQ(view->header.request, 9);
      EXPECT_EQ(proto::read_status(view->body).status, proto::Status::not_supported);
      EXPECT_EQ(answer.answers, 1u);
    }
  }
  set_log_level(LogLevel::info);
}

TEST(Dispatch, SkipsTheExtensionsOfARequest) {
  set_log_level(LogLevel::off);
  TestConductor hub;
  const TestConductor::Node robot = hub.join("robot");
  for (const std::uint8_t size : {std::uint8_t{3}, std::uint8_t{4}}) {
    std::vector<std::byte> payload{std::byte{size}, std::byte{}, std::byte{200}, std::byte{1},
                                   std::byte{}};
    const proto::Payload request = proto::encode(proto::ns::Resolve{"robot"}, 9);
    payload.insert(payload.end(), request.begin(), request.end());
    std::vector<std::byte> frame = control_frame(Kind::ns, NodeId{}, HubId{7}, payload);
    frame[13] = std::byte{proto::kFlagExt};
    hub.conductor.on_event({robot.shard, ControlFrameEvent{robot.session, robot.attachment,
                                                           robot.id, std::move(frame)}},
                           hub.now);
    const auto* answer = std::get_if<SendControlCommand>(&hub.shards.sent.back().command);
    ASSERT_EQ(answer != nullptr, size == 3) << "a length that does not fit closes";
    if (answer == nullptr) continue;
    EXPECT_EQ(
        proto::decode_answer<proto::ns::ResolveAnswer>(TestConductor::payload_of(*answer))->node,
        robot.id);
  }
  set_log_level(LogLevel::info);
}

/// Each role against each operation: who reads may be anybody, who changes the hub an administrator
/// alone.
TEST(Dispatch, GrantsEachRoleExactlyWhatItMay) {
  namespace ctrl = proto::ctrl;
  const std::set<std::uint16_t> known{ctrl::HubInfo::kOperation, ctrl::Statistics::kOperation,
                                      ctrl::Connections::kOperation, ctrl::Hubs::kOperation,
                                      ctrl::LinksRequest::kOperation};
  const std::set<std::uint16_t> changing{
      ctrl::Kick::kOperation,       ctrl::Reassign::kOperation,    ctrl::Drain::kOperation,
      ctrl::Reload::kOperation,     ctrl::SetLogLevel::kOperation, ctrl::LinkAdd::kOperation,
      ctrl::LinkRemove::kOperation, ctrl::SetLinkCost::kOperation};
  const Handler unknown = handler_for(Role::admin, Kind::ctrl, 0xffff);
  for (std::uint32_t operation = 0; operation <= 0xffff; ++operation) {
    const auto number = static_cast<std::uint16_t>(operation);
    const Handler node = handler_for(Role::node, Kind::ctrl, number);
    const Handler admin = handler_for(Role::admin, Kind::ctrl, number);
    EXPECT_EQ(node == &handle_denied, changing.contains(number)) << number;
    EXPECT_NE(admin, &handle_denied) << number;
    EXPECT_EQ(admin == unknown, !known.contains(number) && !changing.contains(number)) << number;
    EXPECT_EQ(node == admin, !changing.contains(number)) << number;
    EXPECT_EQ(handler_for(Role::node, Kind::ns, number), handler_for(Role::admin, Kind::ns, number))
        << number;
  }
}

}  // namespace
}  // namespace gimnet::hub
