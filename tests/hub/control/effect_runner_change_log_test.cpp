#include "hub/control/effect_runner.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <string>

#include "base/log.hpp"
#include "hub/limits.hpp"

namespace gimnet::hub {
namespace {

using proto::ns::ChangeKind;
using ::testing::HasSubstr;

constexpr HubId kHub{7};

class ChangeLog : public ::testing::Test {
 protected:
  ChangeLog() { set_log_level(LogLevel::debug); }
  ~ChangeLog() override { set_log_level(LogLevel::info); }

  Session& join(const char* name) {
    JoinRequest request;
    request.name = name;
    Effects effects;
    return *membership_.join(request, std::chrono::milliseconds{0}, effects)->session;
  }
  template <class Noted>
  std::string line_of(const Noted& noted) {
    ::testing::internal::CaptureStderr();
    log_change(noted, membership_, kHub);
    return ::testing::internal::GetCapturedStderr();
  }

  Limits limits_;
  Membership membership_{Sessions::Options{kHub, 1, Placement::spread}, limits_};
};

TEST_F(ChangeLog, SaysWhoCameAndWent) {
  const Session& robot = join("robot");
  const std::string who = "debug node 7." + std::to_string(robot.index.value()) + " 'robot' ";
  EXPECT_THAT(line_of(NodeNoted{ChangeKind::joined, robot.index, {}, {}}),
              HasSubstr(who + "has joined\n"));
  EXPECT_THAT(line_of(NodeNoted{ChangeKind::away, robot.index, {}, {}}),
              HasSubstr(who + "is away"));
  EXPECT_THAT(line_of(NodeNoted{ChangeKind::renamed, robot.index, {}, "cam"}),
              HasSubstr(who + "has another name, before 'cam'\n"));
  EXPECT_THAT(line_of(NodeNoted{ChangeKind::left, NodeIndex{999}, "gone", {}}),
              HasSubstr("debug node 7.999 'gone' has left for good"));
}

TEST_F(ChangeLog, SaysWhoHasAnotherId) {
  const Session& robot = join("robot");
  EXPECT_THAT(line_of(RenumberDue{robot.place, NodeIndex{5}, robot.index, {}}),
              HasSubstr("node 7.5 'robot' has another id, 7." +
                        std::to_string(robot.index.value()) + "\n"));
}

TEST_F(ChangeLog, SaysWhichServiceWent) {
  EXPECT_THAT(
      line_of(ServiceNoted{ChangeKind::withdrawn, GroupIndex{3}, NodeIndex{5}, "robot/odom"}),
      HasSubstr("debug service 7#3 'robot/odom' was withdrawn, of node 7.5\n"));
}

TEST_F(ChangeLog, IsSilentAtOtherLevels) {
  set_log_level(LogLevel::info);
  EXPECT_EQ(line_of(NodeNoted{ChangeKind::left, NodeIndex{999}, "gone", {}}), "");
}

}  // namespace
}  // namespace gimnet::hub
