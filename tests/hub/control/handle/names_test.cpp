#include "hub/control/handle/names.hpp"

#include <gtest/gtest.h>

#include <map>

#include "base/log.hpp"
#include "proto/control/ns_register.hpp"
#include "tests/hub/control/support/test_conductor.hpp"

namespace gimnet::hub {
namespace {

using namespace std::chrono_literals;
using proto::Status;
namespace ns = proto::ns;

class NamesTest : public ::testing::Test, protected TestConductor {
 protected:
  NamesTest() { set_log_level(LogLevel::off); }
  ~NamesTest() override { set_log_level(LogLevel::info); }
  std::vector<std::string> list(const Node& node, const ns::List& wanted) {
    std::vector<std::string> names;
    const auto answer = ask<ns::ListAnswer>(node, wanted);
    EXPECT_TRUE(answer);
    for (const ns::NodeRecord& record : answer->nodes) names.push_back(record.name);
    return names;
  }
};

TEST_F(NamesTest, ResolvesNamesToIds) {
  const Node robot = join("robot");
  EXPECT_EQ(ask<ns::ResolveAnswer>(robot, ns::Resolve{"robot"})->node, robot.id);
  EXPECT_EQ(ask<ns::ResolveAnswer>(robot, ns::Resolve{"nobody"}).error().status, Status::not_found);
}

TEST_F(NamesTest, ResolvesWhoIsAway) {
  const Node robot = join("robot");
  const Node viewer = join("viewer");
  detach(robot);
  EXPECT_EQ(ask<ns::ResolveAnswer>(viewer, ns::Resolve{"robot"})->node, robot.id);
}

TEST_F(NamesTest, ReversesIdsToNames) {
  const Node robot = join("robot");
  EXPECT_EQ(ask<ns::ReverseAnswer>(robot, ns::Reverse{robot.id})->name, "robot");
  EXPECT_EQ(ask<ns::ReverseAnswer>(robot, ns::Reverse{make_id<NodeId>(kHub, kHubIndex)})->name,
            "hub-7");
  EXPECT_EQ(ask<ns::ReverseAnswer>(robot, ns::Reverse{make_id<NodeId>(kHub, 99)}).error().status,
            Status::not_found);
  EXPECT_EQ(ask<ns::ReverseAnswer>(robot, ns::Reverse{make_id<NodeId>(HubId{8}, 1)}).error().status,
            Status::not_found);
}

TEST_F(NamesTest, ListsNodesWithAllThatIsKnown) {
  proto::Hello hello;
  hello.name = "robot";
  hello.description = "forklift";
  const Node robot = join(hello);
  ASSERT_TRUE(ask<ns::AdvertiseAnswer>(robot, ns::Advertise{.service = "odom"}));
  now += 5s;
  const auto answer = ask<ns::ListAnswer>(robot, ns::List{});
  ASSERT_TRUE(answer);
  ASSERT_EQ(answer->nodes.size(), 1u);
  ns::NodeRecord expected;
  expected.node = robot.id;
  expected.name = "robot";
  expected.hub = kHub;
  expected.hub_name = "hub-7";
  expected.connected = true;
  expected.description = "forklift";
  expected.place = "127.0.0.1:5000";
  expected.joined_ms = 5'000;
  expected.services = 1;
  EXPECT_EQ(answer->nodes[0], expected);
  EXPECT_FALSE(answer->more);
}

TEST_F(NamesTest, ListsByPattern) {
  const Node robot = join("hall/robot-1");
  join("hall/robot-2");
  join("yard/robot-1");
  join("");
  EXPECT_EQ(list(robot, ns::List{.pattern = "hall/*"}).size(), 2u);
  EXPECT_EQ(list(robot, ns::List{.pattern = "**/robot-1"}).size(), 2u);
  EXPECT_EQ(list(robot, ns::List{}).size(), 4u);
  EXPECT_EQ(ask<ns::ListAnswer>(robot, ns::List{.pattern = "a//b"}).error().status,
            Status::bad_request);
}

TEST_F(NamesTest, ListsInPages) {
  const Node first = join("node-0");
  for (int i = 1; i < 600; ++i) join("node-" + std::to_string(i));
  std::size_t seen = 0;
  NodeId after{};
  for (int page = 0; page < 10; ++page) {
    const auto answer = ask<ns::ListAnswer>(first, ns::List{.after = after});
    ASSERT_TRUE(answer);
    ASSERT_LE(answer->nodes.size(), limits.page_records);
    for (const ns::NodeRecord& record : answer->nodes)
      EXPECT_GT(record.node, std::exchange(after, record.node));
    seen += answer->nodes.size();
    if (!answer->more) break;
  }
  EXPECT_EQ(seen, 600u);
}

TEST_F(NamesTest, PagesOfLongRecordsFitInAFrame) {
  proto::Hello hello;
  hello.description = std::string(256, 'd');
  for (int i = 0; i < 250; ++i) {
    hello.name = std::string(250, 'n') + std::to_string(1'000 + i);
    join(hello);
  }
  const Node asker = join("asker");
  std::size_t seen = 0;
  NodeId after{};
  for (int page = 0; page < 20; ++page) {
    const auto answer = ask<ns::ListAnswer>(asker, ns::List{.after = after});
    ASSERT_TRUE(answer);
    EXPECT_LE(std::get<SendControlCommand>(shards.sent.back().command).frame.size(),
              proto::kHeaderSize + limits.frame_bytes);
    seen += answer->nodes.size();
    if (!answer->more) break;
    after = answer->nodes.back().node;
  }
  EXPECT_EQ(seen, 251u);
}

TEST_F(NamesTest, ANodeTakesAnotherNameAndGivesItBack) {
  const Node robot = join("robot");
  const Node viewer = join("viewer");
  const auto renamed = ask<ns::RegisterNameAnswer>(robot, ns::RegisterName{"forklift"});
  ASSERT_TRUE(renamed);
  EXPECT_EQ(renamed->name, "forklift");
  EXPECT_FALSE(renamed->token.empty());
  EXPECT_EQ(ask<ns::ResolveAnswer>(viewer, ns::Resolve{"forklift"})->node, robot.id);
  EXPECT_EQ(ask<ns::ResolveAnswer>(viewer, ns::Resolve{"robot"}).error().status, Status::not_found);
  EXPECT_EQ(ask<ns::RegisterNameAnswer>(robot, ns::RegisterName{"viewer"}).error().status,
            Status::taken);
  ASSERT_TRUE(ask<ns::UnregisterNameAnswer>(robot, ns::UnregisterName{}));
  EXPECT_EQ(ask<ns::ReverseAnswer>(viewer, ns::Reverse{robot.id})->name, "");
  EXPECT_EQ(ask<ns::UnregisterNameAnswer>(robot, ns::UnregisterName{}).error().status,
            Status::not_found);
}

TEST_F(NamesTest, TheTokenOfANewNameBringsThatNameBack) {
  const Node robot = join("robot");
  const auto renamed = ask<ns::RegisterNameAnswer>(robot, ns::RegisterName{"forklift"});
  ASSERT_TRUE(renamed);
  detach(robot);
  proto::Hello hello;
  hello.name = "forklift";
  hello.token = renamed->token;
  EXPECT_EQ(join(hello).id, robot.id);
}

TEST_F(NamesTest, AnUnreadableRequestIsABadOne) {
  const Node robot = join("robot");
  proto::Payload payload = proto::encode(ns::Resolve{"robot"}, 5);
  payload.back() = std::byte{0xff};  // no UTF-8 any more
  send_frame(robot, proto::Kind::ns, payload);
  const auto& answer = std::get<SendControlCommand>(shards.sent.back().command);
  EXPECT_EQ(proto::decode_answer<ns::ResolveAnswer>(payload_of(answer)).error().status,
            Status::bad_request);
  EXPECT_TRUE(shards.all<CloseCommand>().empty());
}

/// Nothing but the listed characters makes a name: no other alphabet, no control character, no
/// empty or dotted way up that could mean something else in a path, and nothing that a log line
/// could not hold.
TEST_F(NamesTest, NamesOutsideTheRulesAreRefusedInWords) {
  const Node robot = join("robot");
  const std::vector<std::string> bad{"",
                                     "/",
                                     "/a",
                                     "a/",
                                     "a//b",
                                     "*",
                                     "a/"
                                     "*",
                                     "**",
                                     "a b",
                                     "a#b",
                                     "a+b",
                                     "a\nb",
                                     "a\rb",
                                     "\x1b[31ma",
                                     "%s%n",
                                     "a\tb",
                                     "\xc3\xa4",
                                     "\xd0\xb0",
                                     "\xe2\x80\xae"
                                     "a",
                                     "\xef\xbb\xbf"
                                     "a",
                                     std::string(256, 'a'),
                                     std::string("a\0b", 3)};
  for (const std::string& name : bad) {
    const auto refused = ask<ns::RegisterNameAnswer>(robot, ns::RegisterName{name});
    ASSERT_FALSE(refused) << name;
    EXPECT_EQ(refused.error().status, Status::bad_request) << name;
    EXPECT_EQ(refused.error().sentence.find_first_of("\n\r\x1b"), std::string::npos) << name;
  }
  EXPECT_EQ(ask<ns::ReverseAnswer>(robot, ns::Reverse{robot.id})->name, "robot");
  EXPECT_TRUE(ask<ns::RegisterNameAnswer>(robot, ns::RegisterName{std::string(255, 'a')}))
      << "the longest";
}

TEST_F(NamesTest, ADeepNameIsRefusedHoweverDeep) {
  const Node robot = join("robot");
  std::string name = "a";
  for (int i = 1; i < 16; ++i) name += "/a";
  EXPECT_TRUE(ask<ns::RegisterNameAnswer>(robot, ns::RegisterName{name})) << "16 parts";
  EXPECT_EQ(ask<ns::RegisterNameAnswer>(robot, ns::RegisterName{name + "/a"}).error().status,
            Status::bad_request);
  proto::bitestream::Writer separators;
  separators.put_text(3, std::string(60'000, '/'));
  send_frame(robot, proto::Kind::ns,
             proto::assemble_control({ns::RegisterName::kOperation, 7}, separators));
  const auto& answer = std::get<SendControlCommand>(shards.sent.back().command);
  EXPECT_EQ(proto::decode_answer<ns::RegisterNameAnswer>(payload_of(answer)).error().status,
            Status::bad_request);
}

/// Claims of one name, however they come: there is one holder at any time, and the other is told
/// who it is.
TEST_F(NamesTest, OneOfTwoClaimantsHasTheName) {
  const Node first = join("first");
  const Node second = join("second");
  ASSERT_TRUE(ask<ns::RegisterNameAnswer>(first, ns::RegisterName{"robot"}));
  const auto refused = ask<ns::RegisterNameAnswer>(second, ns::RegisterName{"robot"});
  EXPECT_EQ(refused.error().status, Status::taken);
  EXPECT_NE(refused.error().sentence.find("127.0.0.1:5000"), std::string::npos)
      << refused.error().sentence;
  EXPECT_EQ(ask<ns::ResolveAnswer>(second, ns::Resolve{"robot"})->node, first.id);
  EXPECT_EQ(ask<ns::ResolveAnswer>(first, ns::Resolve{"second"})->node, second.id);
}

/// Taking and giving back a name for ever leaves nothing behind.
TEST_F(NamesTest, ChangingTheNameForEverKeepsNothing) {
  limits.watch_changes = 1'000;
  limits.declarations_burst = 100'000;
  const Node robot = join("robot");
  for (int i = 0; i < 20'000; ++i) {
    ASSERT_TRUE(ask<ns::RegisterNameAnswer>(robot, ns::RegisterName{i % 2 == 0 ? "a" : "b"}));
    ASSERT_TRUE(ask<ns::UnregisterNameAnswer>(robot, ns::UnregisterName{}));
    shards.sent.clear();
  }
  EXPECT_EQ(conductor.membership().directory().size(), 0u);
  EXPECT_EQ(conductor.membership().topics().by_name().size(), 0u);
}

TEST_F(NamesTest, ListsConnectedNodesOnlyIfTold) {
  const Node robot = join("robot");
  const Node away = join("away");
  detach(away);
  EXPECT_EQ(list(robot, ns::List{}), (std::vector<std::string>{"robot", "away"}));
  EXPECT_EQ(list(robot, ns::List{.connected_only = true}), (std::vector<std::string>{"robot"}));
}

/// A pattern that fits few of many is answered piece by piece, so that nobody waits for it.
TEST_F(NamesTest, APatternThatFitsNobodyIsAnsweredInPieces) {
  limits.scan_records = 64;
  const Node first = join("node-0");
  for (int i = 1; i < 300; ++i) join("node-" + std::to_string(i));
  NodeId after{};
  int pages = 0;
  for (bool more = true; more; ++pages) {
    ASSERT_LT(pages, 10);
    const auto answer = ask<ns::ListAnswer>(first, ns::List{.pattern = "*/nobody", .after = after});
    ASSERT_TRUE(answer);
    EXPECT_TRUE(answer->nodes.empty());
    more = answer->more;
    after = answer->next;
  }
  EXPECT_EQ(pages, 5);
}

TEST_F(NamesTest, AStormOfNamesIsRefusedByRateAndLeavesNothing) {
  const Node robot = join("first");
  const Node viewer = join("");
  std::map<Status, int> said;
  const auto change = [&](int i) {
    const auto taken =
        ask<ns::RegisterNameAnswer>(robot, ns::RegisterName{"robot-" + std::to_string(i)});
    const auto freed = ask<ns::UnregisterNameAnswer>(robot, ns::UnregisterName{});
    ++said[taken ? Status::done : taken.error().status];
    ++said[freed ? Status::done : freed.error().status];
    shards.sent.clear();
  };
  for (int i = 0; i < 100'000; ++i) change(i);
  EXPECT_EQ(said[Status::done], 2'048);
  EXPECT_EQ(said[Status::rate], 100'000 - 1'024);
  EXPECT_EQ(said[Status::not_found], 100'000 - 1'024) << "there was nothing to give back";
  EXPECT_LE(conductor.membership().directory().size(), 1u) << "memory stays as it was";
  EXPECT_TRUE(ask<ns::RegisterNameAnswer>(viewer, ns::RegisterName{"viewer"}))
      << "others have rates of their own";
  // As much as time gives, however long the storm lasts.
  said.clear();
  for (int second = 0; second < 10; ++second) {
    now += 1s;
    for (int i = 0; i < 1'000; ++i) change(i);
  }
  EXPECT_EQ(said[Status::done], 5'000);
}

TEST_F(NamesTest, WhatItHasAlreadyIsNoNewName) {
  limits.declarations_burst = 1;
  limits.services_per_node = limits.subscriptions_per_node = 0;
  const Node robot = join("robot");
  for (int i = 0; i < 10; ++i)
    ASSERT_TRUE(ask<ns::RegisterNameAnswer>(robot, ns::RegisterName{"robot"}));
  EXPECT_TRUE(ask<ns::RegisterNameAnswer>(robot, ns::RegisterName{"crane"}));
  EXPECT_EQ(ask<ns::UnregisterNameAnswer>(robot, ns::UnregisterName{}).error().status,
            Status::rate);
  EXPECT_EQ(conductor.membership().directory().find("crane"), node_index_of(robot.id));
}

}  // namespace
}  // namespace gimnet::hub
