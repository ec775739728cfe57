#include "tools/demo/summary.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

namespace gimnet::demo {
namespace {

using testing::ElementsAre;
using testing::HasSubstr;
using testing::IsEmpty;

/// A machine of which one message of each stream came, and one command was obeyed.
LabsRecord::Machine machine() {
  LabsRecord::Machine one{"crawler-1", "driven over the WAN", "north", "south", Monitor(0), {}};
  Odometry odometry;
  odometry.stamp = {1, 1};
  one.monitor.take(odometry, 2);
  Scan scan;
  scan.stamp = {1, 1};
  one.monitor.take(scan, 2);
  RobotInfo info;
  info.stamp = {1, 1};
  info.odometry_total = info.scan_total = info.drive_total = 1;
  one.monitor.take(info, 2);
  one.monitor.take(HubCounters{});
  one.run.commands = 1;
  one.run.finished = true;
  one.run.own_hub = false;
  return one;
}

LabsRecord good() {
  LabsRecord record;
  record.machines.push_back(machine());
  record.hubs.push_back({"north", {}});
  record.pictures = 100;
  record.picture_bytes = 1'000;
  record.seen = {100, 100};
  record.wan_bytes = 120'000;
  record.cuts = 1;
  return record;
}

TEST(LabsSummary, SaysThatNothingWasLost) {
  EXPECT_THAT(complaints_about(good()), IsEmpty());
  const std::string text = summary_text(good());
  EXPECT_THAT(text, HasSubstr("crawler-1  driven over the WAN "));
  EXPECT_THAT(text, HasSubstr("100 pictures of 1,000 bytes, seen by 2 viewers"));
  EXPECT_THAT(text, HasSubstr("1.20 times the pictures; cut 1 time\n"));
  EXPECT_THAT(text, HasSubstr("Nothing was lost."));
}

TEST(LabsSummary, NamesEveryLoss) {
  LabsRecord record = good();
  record.machines[0].run.commands = 2;
  record.hubs[0].counters.drops = {{"no_route", 3}, {"replaced", 5}};
  record.hubs[0].counters.accepted = 9;
  record.seen[1] = 99;
  EXPECT_THAT(
      complaints_about(record),
      ElementsAre(HasSubstr("crawler-1: robot/drive: 2 commands were sent, 1 reached"),
                  "hub north dropped 3 frames: no_route", "the ledger of hub north does not add up",
                  "camera/eye: 100 pictures were sent, a viewer has 99"));
  EXPECT_THAT(summary_text(record), HasSubstr("Not as it should be:"));
}

TEST(LabsSummary, PicturesCrossTheWanOnce) {
  LabsRecord record = good();
  record.wan_bytes = 220'000;
  EXPECT_THAT(complaints_about(record), ElementsAre(HasSubstr("crossed the WAN more than once")));
  record.pictures = 0;
  record.seen = {0, 0};
  EXPECT_THAT(complaints_about(record), ElementsAre(HasSubstr("there was no picture")));
}

}  // namespace
}  // namespace gimnet::demo
