#include "tools/demo/summary.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

namespace gimnet::demo {
namespace {

using testing::Contains;
using testing::HasSubstr;
using testing::IsEmpty;
using testing::Not;

HubCounters exact_counters() {
  HubCounters counters;
  counters.add("accepted", 100);
  counters.add("copies", 10);
  counters.add("delivered", 110);
  return counters;
}

// Heard `received` messages of odometry, of `sent`.
Monitor heard(std::uint64_t received, std::uint64_t sent) {
  Monitor monitor(0);
  RobotInfo info;
  info.source = "simulation";
  info.odometry_total = sent;
  info.drive_total = 5;
  info.ended = true;
  monitor.take(info, 0);
  for (std::uint64_t number = 1; number <= received; ++number) {
    Odometry odometry;
    odometry.stamp.number = number;
    odometry.pose.x_m = static_cast<double>(number) * 0.1;
    monitor.take(odometry, 85'000);
  }
  monitor.take(exact_counters());
  return monitor;
}

RunRecord run() { return {"tcp://127.0.0.1:1", 2.0, 5, 1, true, true, ""}; }

TEST(Summary, IsContentWhereEverythingArrived) {
  EXPECT_THAT(complaints_about(heard(80, 80), run()), IsEmpty());
  const std::string text = summary_text(heard(80, 80), run(), true);
  for (const char* expected : {"robot/odom", "40.0", "85 µs",
                               "accepted 100 + copies 10\n       = delivered 110 + dropped 0",
                               "exact", "7.9 m, 1 of the course's corners", "Nothing was lost."}) {
    EXPECT_THAT(text, HasSubstr(expected));
  }
}

TEST(Summary, CountsBothEnds) {
  EXPECT_THAT(complaints_about(heard(79, 80), run()),
              Contains(HasSubstr("the robot sent 80 messages, 79 arrived")));
  RunRecord more = run();
  more.commands = 6;
  EXPECT_THAT(complaints_about(heard(80, 80), more),
              Contains(HasSubstr("6 commands were sent, 5 reached")));
}

TEST(Summary, SeesGapsAlsoOfARobotThatGoesOn) {
  Monitor monitor = heard(3, 0);
  Odometry odometry;
  odometry.stamp.number = 7;
  monitor.take(odometry, 0);
  RunRecord open = run();
  open.finished = false;
  EXPECT_THAT(complaints_about(monitor, open), Contains(HasSubstr("3 messages were missed")));
  EXPECT_THAT(summary_text(monitor, open, true), HasSubstr("Not as it should be"));
}

TEST(Summary, DropsOfTheHubAreLossesButReplacedOnesAreNot) {
  Monitor monitor = heard(80, 80);
  HubCounters counters = exact_counters();
  counters.add("accepted", 3);
  counters.add("dropped.replaced", 3);
  monitor.take(counters);
  EXPECT_THAT(complaints_about(monitor, run()), IsEmpty());
  counters.add("accepted", 2);
  counters.add("dropped.queue_full", 2);
  monitor.take(counters);
  EXPECT_THAT(complaints_about(monitor, run()), Contains("the hub dropped 2 frames: queue_full"));
}

TEST(Summary, DropsOfASharedHubMayBeThoseOfOthers) {
  Monitor monitor = heard(80, 80);
  HubCounters counters = exact_counters();
  counters.add("accepted", 2);
  counters.add("dropped.link_lost", 2);
  monitor.take(counters);
  RunRecord shared = run();
  shared.own_hub = false;
  EXPECT_THAT(complaints_about(monitor, shared), IsEmpty());
  EXPECT_THAT(summary_text(monitor, shared, true), HasSubstr("dropped: 2 link_lost"));
}

TEST(Summary, TheLedgerMustAddUp) {
  Monitor monitor = heard(80, 80);
  HubCounters counters = exact_counters();
  counters.add("accepted", 1);
  monitor.take(counters);
  EXPECT_THAT(complaints_about(monitor, run()), Contains(HasSubstr("ledger does not add up")));
}

TEST(Summary, SaysWhyARunWasBroken) {
  RunRecord broken = run();
  broken.finished = false;
  broken.broken = "the hub was ended by signal 9";
  EXPECT_THAT(complaints_about(heard(80, 80), broken),
              testing::ElementsAre("the hub was ended by signal 9"));
  EXPECT_THAT(complaints_about(Monitor(0), broken),
              testing::ElementsAre("the hub was ended by signal 9"));
}

TEST(Summary, SilenceIsALoss) {
  EXPECT_THAT(complaints_about(Monitor(0), run()), Contains(HasSubstr("never heard")));
  EXPECT_THAT(complaints_about(heard(0, 0), run()),
              testing::ElementsAre(HasSubstr("no message came at all")));
  Monitor without_hub(0);
  without_hub.take(RobotInfo{}, 0);
  EXPECT_THAT(complaints_about(without_hub, run()),
              Contains(HasSubstr("did not give its counters")));
}

TEST(Summary, WhatALogDoesNotHoldIsNotMissed) {
  EXPECT_THAT(complaints_about(heard(80, 80), run()), IsEmpty()) << "no scan";
  Monitor only_scans = heard(0, 0);
  RobotInfo info = only_scans.info().value();
  info.scan_total = 1;
  only_scans.take(info, 0);
  Scan scan;
  scan.stamp.number = 1;
  only_scans.take(scan, 0);
  EXPECT_THAT(complaints_about(only_scans, run()), IsEmpty());
  info.odometry_total = 1;
  only_scans.take(info, 0);
  RunRecord open = run();
  open.finished = false;
  EXPECT_THAT(complaints_about(only_scans, open),
              testing::ElementsAre("robot/odom: no message came at all"));
}

TEST(Summary, IsAsciiWhereItMustBe) {
  const std::string text = summary_text(heard(80, 80), run(), false);
  for (const char c : text) EXPECT_TRUE(c == '\n' || (c >= ' ' && c <= '~')) << static_cast<int>(c);
  EXPECT_THAT(text, HasSubstr("85 us"));
  EXPECT_THAT(text, Not(HasSubstr("?")));
}

}  // namespace
}  // namespace gimnet::demo
