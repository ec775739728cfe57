#include "tools/demo/viewer.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <memory>

#include "tests/tools/demo/fake_network.hpp"
#include "tools/demo/log_player.hpp"
#include "tools/demo/robot.hpp"
#include "tools/demo/simulated_robot.hpp"

namespace gimnet::demo {
namespace {

using testing::HasSubstr;
using testing::IsEmpty;
using testing::Not;

// A robot in the hall and its viewer, half a second long.
class ViewerTest : public testing::Test {
 protected:
  ViewerTest() {
    network_.viewer.when_idle = [this] { EXPECT_FALSE(robot_.step()); };
    options_.seconds = 0.5;
    options_.autopilot = true;
    options_.hub_url = "tcp://127.0.0.1:1";
    options_.style = {true, ColourDepth::kNone};
  }

  FakeNetwork network_;
  Robot robot_{network_.robot, [](std::int64_t now_ns) {
                 return std::make_unique<SimulatedRobot>(WorldMap::hall(), now_ns);
               }};
  ViewerOptions options_;
};

TEST_F(ViewerTest, DrivesTheCourseAndLosesNothing) {
  Viewer viewer(network_.viewer, nullptr, options_);
  ASSERT_FALSE(viewer.run());
  EXPECT_THAT(complaints_about(viewer.monitor(), viewer.record()), IsEmpty());
  EXPECT_TRUE(viewer.record().finished);
  EXPECT_GE(viewer.monitor().odometry_stream().received, 18U);
  EXPECT_GT(viewer.record().commands, 5U);
  EXPECT_TRUE(robot_.finished());
}

TEST_F(ViewerTest, CountsNoCommandThatCannotBeSentAtTheMoment) {
  network_.commands_go = false;
  const std::int64_t until_ns = network_.now_ns + 250'000'000;
  options_.on_look = [&](const Monitor& heard, std::int64_t now_ns) {
    EXPECT_GT(now_ns, 0);
    network_.commands_go = heard.odometry() && now_ns > until_ns;
  };
  Viewer viewer(network_.viewer, nullptr, options_);
  ASSERT_FALSE(viewer.run());
  EXPECT_THAT(complaints_about(viewer.monitor(), viewer.record()), IsEmpty());
  EXPECT_TRUE(viewer.record().finished);
  EXPECT_LT(viewer.record().commands, 9U);
}

TEST_F(ViewerTest, LossesAreAsTheyShouldBeWhereTheyAreExcused) {
  network_.lose_each = 11;
  options_.excuse = [](std::int64_t) { return true; };
  Viewer viewer(network_.viewer, nullptr, options_);
  ASSERT_FALSE(viewer.run());
  EXPECT_GT(viewer.monitor().odometry_stream().excused, 0U);
  EXPECT_EQ(viewer.record().commands_excused, viewer.record().commands);
  for (const std::string& complaint : complaints_about(viewer.monitor(), viewer.record()))
    EXPECT_THAT(complaint, HasSubstr("the hub dropped"));
}

TEST_F(ViewerTest, SeesThatMessagesWereLost) {
  network_.lose_each = 7;
  Viewer viewer(network_.viewer, nullptr, options_);
  ASSERT_FALSE(viewer.run());
  EXPECT_THAT(complaints_about(viewer.monitor(), viewer.record()), Not(IsEmpty()));
}

TEST_F(ViewerTest, ReportsProgressAndPaints) {
  std::string progress;
  options_.on_progress = [&](const std::string& line) { progress += line; };
  Viewer viewer(network_.viewer, nullptr, options_);
  ASSERT_FALSE(viewer.run());
  EXPECT_THAT(progress, HasSubstr("odom"));
  EXPECT_THAT(viewer.last_picture({80, 24}), HasSubstr("simulation"));
}

TEST_F(ViewerTest, EndsWhenAnotherProcessIsInTrouble) {
  options_.trouble = [](std::int64_t) { return std::optional(Error{"the hub ended"}); };
  Viewer viewer(network_.viewer, nullptr, options_);
  const std::optional<Error> error = viewer.run();
  ASSERT_TRUE(error);
  EXPECT_EQ(error->sentence, "the hub ended");
}

TEST_F(ViewerTest, ABrokenConnectionIsExplainedByTheEndOfAProcess) {
  // The process is not seen to have ended when the connection breaks, only a moment later.
  options_.trouble = [](std::int64_t wait_ns) {
    return wait_ns > 0 ? std::optional(Error{"the hub was ended by signal 9"}) : std::nullopt;
  };
  options_.on_progress = [this](const std::string&) {
    network_.broken = Error{"cannot send to 1.1"};
  };
  Viewer viewer(network_.viewer, nullptr, options_);
  network_.viewer.when_idle = [this] { static_cast<void>(robot_.step()); };
  const std::optional<Error> error = viewer.run();
  ASSERT_TRUE(error);
  EXPECT_EQ(error->sentence, "the hub was ended by signal 9");
  EXPECT_GT(viewer.monitor().odometry_stream().received, 0U) << "what was heard before";
  const std::string summary = summary_text(viewer.monitor(), viewer.record(), true);
  EXPECT_THAT(summary, HasSubstr("Not as it should be:\n  the hub was ended by signal 9"));
}

TEST_F(ViewerTest, WithoutAUserItEndsWithTheLog) {
  RobotLog log;
  log.records.resize(3);
  log.records[2].due_s = 0.1;
  Robot player(network_.robot, [log](std::int64_t now_ns) {
    return std::make_unique<LogPlayer>(log, LogPlayer::Start{"a.log", 1.0, now_ns});
  });
  network_.viewer.when_idle = [&player] { EXPECT_FALSE(player.step()); };
  options_.seconds.reset();
  Viewer viewer(network_.viewer, nullptr, options_);
  ASSERT_FALSE(viewer.run());
  EXPECT_THAT(complaints_about(viewer.monitor(), viewer.record()), IsEmpty());
  EXPECT_EQ(viewer.monitor().odometry_stream().received, 3U);
}

TEST_F(ViewerTest, ARobotThatOnlyScansIsHeard) {
  RobotLog log;
  log.records.resize(100);
  for (std::size_t index = 0; index < log.records.size(); ++index) {
    log.records[index].due_s = 0.1 * static_cast<double>(index);
    log.records[index].ranges_m = {1.0F};
    log.records[index].pose = {3.0, 4.0, 0.0};
  }
  Robot player(network_.robot, [log](std::int64_t now_ns) {
    return std::make_unique<LogPlayer>(log, LogPlayer::Start{"a.log", 1.0, now_ns});
  });
  network_.viewer.when_idle = [&player] { EXPECT_FALSE(player.step()); };
  std::string progress;
  options_.on_progress = [&](const std::string& line) { progress += line; };
  Viewer viewer(network_.viewer, nullptr, options_);
  ASSERT_FALSE(viewer.run());
  EXPECT_THAT(complaints_about(viewer.monitor(), viewer.record()), IsEmpty());
  EXPECT_THAT(progress, HasSubstr("at 3.00 4.00 m"));
  // The time was over, not the log.
  EXPECT_LT(viewer.monitor().scan_stream().received, 10U);
  EXPECT_THAT(viewer.last_picture({80, 24}), HasSubstr("3.00   4.00 m"));
}

TEST_F(ViewerTest, ARobotOfOthersIsNotToldToFinish) {
  options_.own_robot = false;
  options_.seconds = 0.2;
  Viewer viewer(network_.viewer, nullptr, options_);
  ASSERT_FALSE(viewer.run());
  EXPECT_FALSE(robot_.finished());
  EXPECT_THAT(complaints_about(viewer.monitor(), viewer.record()), IsEmpty());
}

}  // namespace
}  // namespace gimnet::demo
