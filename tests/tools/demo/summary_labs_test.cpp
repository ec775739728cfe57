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

/// A viewer that got so many pictures, and missed others.
StreamRecord seen(std::uint64_t pictures, std::uint64_t missed = 0, std::uint64_t excused = 0) {
  StreamRecord record;
  record.received = pictures;
  record.missed = missed;
  record.excused = excused;
  return record;
}

LabsRecord good() {
  LabsRecord record;
  record.machines.push_back(machine());
  record.hubs.push_back({"north", {}});
  record.pictures = 100;
  record.picture_bytes = 1'000;
  record.seen = {seen(100), seen(100)};
  record.wan_bytes = 120'000;
  record.cuts = 1;
  return record;
}

void expect_narrow(const std::string& text) {
  for (std::size_t begin = 0; begin < text.size(); begin = text.find('\n', begin) + 1)
    EXPECT_LE(text.find('\n', begin) - begin, 80u) << text.substr(begin, 90);
}

TEST(LabsSummary, SaysThatNothingWasLost) {
  EXPECT_THAT(complaints_about(good()), IsEmpty());
  const std::string text = summary_text(good());
  EXPECT_THAT(text, HasSubstr("crawler-1  driven over the WAN "));
  EXPECT_THAT(text, HasSubstr("100 pictures of 1,000 bytes for 2 viewers, 0 lost\n"));
  EXPECT_THAT(text,
              HasSubstr("cut 1 time; 120,000 bytes to the viewers, 1.20 times the pictures\n"));
  EXPECT_THAT(text, HasSubstr("Nothing was lost."));
  expect_narrow(text);
}

TEST(LabsSummary, SaysWhatTheCutsExplain) {
  LabsRecord record = good();
  record.machines[0].run.commands = 4;
  record.machines[0].run.commands_excused = 3;
  record.hubs[0].counters.drops = {{"no_route", 3}, {"link_lost", 1},     {"link_unsure", 1},
                                   {"away", 1},     {"no_subscriber", 2}, {"replaced", 5}};
  record.hubs[0].counters.accepted = 13;
  record.seen = {seen(90, 10, 10), seen(100)};
  EXPECT_THAT(complaints_about(record), IsEmpty());
  EXPECT_THAT(summary_text(record), HasSubstr("As it should be: 13 messages were lost"));
  expect_narrow(summary_text(record));
  record.cuts = 0;
  EXPECT_THAT(
      complaints_about(record),
      ElementsAre("hub north dropped 1 frames: away", "hub north dropped 1 frames: link_lost",
                  "hub north dropped 1 frames: link_unsure", "hub north dropped 3 frames: no_route",
                  "hub north dropped 2 frames: no_subscriber"));
}

TEST(LabsSummary, NamesWhatTheCutsDoNotExplain) {
  LabsRecord record = good();
  record.machines[0].run.commands = 5;
  record.machines[0].run.commands_excused = 3;
  record.hubs[0].counters.drops = {{"queue_full", 1}};
  record.hubs[0].counters.accepted = 1;
  record.seen[0] = seen(90, 10, 9);
  EXPECT_THAT(
      complaints_about(record),
      ElementsAre(HasSubstr("crawler-1: robot/drive: 5 commands were sent, 1 reached"),
                  "hub north dropped 1 frames: queue_full",
                  "camera/eye: 100 pictures were sent, a viewer has 90, and the cuts explain 9"));
  record = good();
  record.machines[0].run.finished = false;
  EXPECT_THAT(complaints_about(record),
              ElementsAre("crawler-1: did not tell at the end what it had sent"));
}

TEST(LabsSummary, NamesEveryLoss) {
  LabsRecord record = good();
  record.machines[0].run.commands = 2;
  record.hubs[0].counters.drops = {{"queue_full", 3}, {"replaced", 5}};
  record.hubs[0].counters.accepted = 9;
  record.seen[1] = seen(99);
  EXPECT_THAT(complaints_about(record),
              ElementsAre(HasSubstr("crawler-1: robot/drive: 2 commands were sent, 1 reached"),
                          "hub north dropped 3 frames: queue_full",
                          "the ledger of hub north does not add up",
                          "camera/eye: 100 pictures were sent, a viewer has 99"));
  EXPECT_THAT(summary_text(record), HasSubstr("Not as it should be:"));
}

TEST(LabsSummary, PicturesCrossTheWanOnce) {
  LabsRecord record = good();
  record.wan_bytes = 220'000;
  EXPECT_THAT(complaints_about(record), ElementsAre(HasSubstr("crossed the WAN more than once")));
  record.pictures = 0;
  record.seen = {seen(0), seen(0)};
  EXPECT_THAT(complaints_about(record), ElementsAre(HasSubstr("there was no picture")));
}

}  // namespace
}  // namespace gimnet::demo
