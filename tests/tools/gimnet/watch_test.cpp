#include "tools/gimnet/watch.hpp"

#include <gtest/gtest.h>

#include <cstdlib>
#include <ctime>

#include "tools/gimnet/session.hpp"

namespace gimnet::tool {
namespace {

constexpr std::int64_t kNoon = (12ll * 3600 + 34 * 60 + 56) * 1'000'000'000 + 789'000'000;

WatchEvent node_event(Change change, std::uint32_t index, const std::string& name,
                      const std::string& description) {
  WatchEvent event;
  event.change = change;
  event.hub_id = 7;
  event.epoch = 3;
  event.version = 9;
  NodeRecord node;
  node.node = Peer{(7u << 20) | index};
  node.name = name;
  node.description = description;
  node.hub_name = "lab";
  node.hub_id = 7;
  event.node = node;
  return event;
}

TEST(WatchReport, ALineForPeople) {
  ::setenv("TZ", "UTC", 1);
  ::tzset();
  WatchEvent joined = node_event(Change::joined, 17, "robot", "a\x1b[2J");
  joined.node->place = "127.0.0.1:5";
  EXPECT_EQ(text_line(joined, kNoon),
            "12:34:56.789  joined       node robot 7.17, from 127.0.0.1:5, a.[2J\n");
  WatchEvent renamed = node_event(Change::renamed, 17, "two", "");
  renamed.former_name = "one";
  EXPECT_EQ(text_line(renamed, kNoon), "12:34:56.789  renamed      node two 7.17, before one\n");
  WatchEvent service;
  service.change = Change::withdrawn;
  service.service.emplace();
  service.service->name = "robot/odom";
  service.service->node = Peer{(7u << 20) | 17};
  EXPECT_EQ(text_line(service, kNoon, Paint(true)),
            "\x1b[31m12:34:56.789  withdrawn    service robot/odom of 7.17\x1b[0m\n");
  EXPECT_EQ(text_line(WatchEvent{}, kNoon), "") << "of the watch itself";
}

TEST(WatchReport, AnObjectForPrograms) {
  EXPECT_EQ(json_line(node_event(Change::left, 17, "robot", ""), 5),
            R"({"time_ns":5,"change":"left","hub_id":7,"epoch":3,"version":9,)"
            R"("node":{"id":"7.17","name":"robot","hub_id":7}})"
            "\n");
  EXPECT_EQ(
      json_line(node_event(Change::joined, 17, "robot", ""), 5),
      R"({"time_ns":5,"change":"joined","hub_id":7,"epoch":3,"version":9,"node":{"id":"7.17","name":"robot",)"
      R"("hub":"lab","hub_id":7,"connected":false,"state":"away","description":"","place":"","joined_ms":0,"services":0}})"
      "\n");
  EXPECT_EQ(json_line(WatchEvent{}, 5),
            R"({"time_ns":5,"change":"snapshot_begins","hub_id":0,"epoch":0,"version":0})"
            "\n");
}

TEST(WatchReport, OfAWithdrawnServiceOnlyWhoItWas) {
  WatchEvent event;
  event.change = Change::withdrawn;
  event.service.emplace();
  event.service->name = "robot/odom";
  event.service->node = Peer{(7u << 20) | 17};
  event.service->group_id = 12;
  EXPECT_EQ(json_line(event, 5),
            R"({"time_ns":5,"change":"withdrawn","hub_id":0,"epoch":0,"version":0,)"
            R"("service":{"name":"robot/odom","node":"7.17","group":12}})"
            "\n");
}

TEST(WatchReport, OfWaysToHubs) {
  HubWays ways;
  const NodeRecord robot = *node_event(Change::present, 17, "robot", "").node;
  NetworkHub lab;
  lab.hub_id = 7;
  lab.name = "lab";
  EXPECT_TRUE(ways.take({lab}).empty()) << "it was not known before";
  EXPECT_EQ(ways.standing_of(robot), kUnreachable);
  EXPECT_EQ(text_line(node_event(Change::present, 17, "robot", ""), kNoon, Paint{}, ways),
            "12:34:56.789  present      node robot 7.17, unreachable\n");
  EXPECT_EQ(text_line(lab, kNoon), "12:34:56.789  unreachable  hub 7 lab\n");
  lab.reachable = true;
  EXPECT_EQ(ways.take({lab}).size(), 1u);
  EXPECT_TRUE(ways.take({lab}).empty());
  EXPECT_EQ(ways.standing_of(robot), "away");
  EXPECT_EQ(json_line(lab, 5), R"({"time_ns":5,"change":"reachable","hub_id":7,"hub":"lab"})"
                               "\n");
}

TEST(HubWays, TellHubsThatComeOrGo) {
  HubWays ways;
  NetworkHub own;
  own.hub_id = 1;
  own.reachable = true;
  NetworkHub other = own;
  other.hub_id = 2;
  other.name = "lab";
  EXPECT_TRUE(ways.take({own}).empty()) << "it was there before";
  const auto came = ways.take({own, other});
  ASSERT_EQ(came.size(), 1u);
  EXPECT_EQ(came[0].hub_id, 2u);
  EXPECT_TRUE(came[0].reachable);
  const auto went = ways.take({own});
  ASSERT_EQ(went.size(), 1u) << "it is not listed any more";
  EXPECT_EQ(went[0].name, "lab");
  EXPECT_FALSE(went[0].reachable);
  other.reachable = false;
  EXPECT_TRUE(ways.take({own, other}).empty()) << "there was no way to it before";
  EXPECT_TRUE(ways.take({own}).empty());
}

TEST(WatchReport, KnowsWhatWasThereBefore) {
  EXPECT_TRUE(is_snapshot(Change::snapshot_begins));
  EXPECT_TRUE(is_snapshot(Change::present));
  EXPECT_TRUE(is_snapshot(Change::snapshot_ends));
  EXPECT_FALSE(is_snapshot(Change::joined));
}

TEST(WatchMemory, TellsWhatWasDifferentBeforeAChange) {
  WatchMemory memory;
  WatchEvent event;
  event.change = Change::changed;
  event.service.emplace();
  event.service->name = "robot/odom";
  event.service->node = Peer{(7u << 20) | 17};
  event.service->metadata = "slow";
  EXPECT_EQ(memory.take(event), "") << "it was not known";
  event.service->metadata = "fast";
  event.service->node = Peer{(7u << 20) | 18};
  const std::string before = memory.take(event);
  EXPECT_EQ(before, ", before: node 7.17 metadata slow");
  EXPECT_EQ(text_line(event, kNoon, Paint{}, {}, before),
            "12:34:56.789  changed      service robot/odom of 7.18, fast, before: node 7.17 "
            "metadata slow\n");
  event.change = Change::withdrawn;
  EXPECT_EQ(memory.take(event), "");
  event.change = Change::changed;
  EXPECT_EQ(memory.take(event), "") << "it was gone";
  event.service->retain = true;
  EXPECT_EQ(memory.take(event), ", before: other terms");
  WatchEvent node = node_event(Change::joined, 17, "robot", "");
  EXPECT_EQ(memory.take(node), "");
  node.change = Change::changed;
  node.node->description = "new";
  EXPECT_EQ(memory.take(node), ", before: description none");
  EXPECT_EQ(memory.take(WatchEvent{}), "") << "a snapshot begins";
  node.node->description = "newer";
  EXPECT_EQ(memory.take(node), "");
}

TEST(ToolFilter, HidesTheWholeLifeOfALook) {
  ToolFilter filter;
  EXPECT_TRUE(filter.hides(node_event(Change::joined, 1, "", kToolDescription)));
  EXPECT_TRUE(filter.hides(node_event(Change::away, 1, "", kToolDescription)));
  EXPECT_TRUE(filter.hides(node_event(Change::left, 1, "", "")))
      << "the last event tells no description";
  EXPECT_FALSE(filter.hides(node_event(Change::joined, 1, "", ""))) << "the id is another's now";
}

TEST(ToolFilter, ShowsWhatThisToolDoesUnderAName) {
  ToolFilter filter;
  EXPECT_FALSE(filter.hides(node_event(Change::joined, 2, "B", kToolDescription)));
  EXPECT_FALSE(filter.hides(node_event(Change::left, 2, "B", "")));
}

TEST(ToolFilter, ForgetsWhenToldAgainFromTheStart) {
  ToolFilter filter;
  EXPECT_TRUE(filter.hides(node_event(Change::present, 1, "", kToolDescription)));
  EXPECT_FALSE(filter.hides(WatchEvent{}));
  EXPECT_FALSE(filter.hides(node_event(Change::present, 1, "", "")));
}

}  // namespace
}  // namespace gimnet::tool
