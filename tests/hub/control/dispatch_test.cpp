#include "hub/control/dispatch.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "base/log.hpp"
#include "hub/control/handle/admin.hpp"
#include "hub/control/handle/names.hpp"
#include "proto/control/ctrl.hpp"
#include "proto/control/ns.hpp"
#include "tests/hub/control/support/test_conductor.hpp"

namespace gimnet::hub {
namespace {

using proto::Kind;
using proto::Role;

TEST(Dispatch, FindsHandlersByKindAndOperation) {
  EXPECT_EQ(handler_for(Role::node, Kind::ns, proto::ns::Resolve::kOperation), &handle_resolve);
  EXPECT_EQ(handler_for(Role::admin, Kind::ctrl, proto::ctrl::HubInfo::kOperation), &handle_hub_info);
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

}  // namespace
}  // namespace gimnet::hub
