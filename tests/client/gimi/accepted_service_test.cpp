#include "client/gimi/accepted_service.hpp"

#include <gtest/gtest.h>

#include <optional>
#include <string>

#include "gimnet/gimi.hpp"
#include "tests/client/gimi/support/hub_process.hpp"

namespace gimnet {
namespace {

using gimi::AcceptedTable;
using gimi::Inbox;
using gimi::ServiceTable;
using gimi::Uplink;
using test::eventually;
using test::HubProcess;
using test::kPatience;

constexpr Timeout kWait = std::chrono::duration_cast<Timeout>(kPatience);

/// The table alone: the uplink was never opened.
class AcceptedTableTest : public testing::Test {
 protected:
  using Place = ServiceTable::Place;
  AcceptedTable::Service add(const std::string& name, std::uint32_t group) {
    auto service = table_.add("robot", name, {});
    table_.place(service, group);
    return service;
  }
  Uplink uplink_;
  Inbox inbox_{10, 1000, [] {}};
  AcceptedTable table_{uplink_, inbox_};
};

TEST_F(AcceptedTableTest, FindsAServiceByItsGroup) {
  const auto drive = add("drive", 5);
  const auto stop = add("stop", 6);
  EXPECT_EQ(table_.find(5).service, drive);
  EXPECT_EQ(table_.find(6).service, stop);
  EXPECT_EQ(table_.find(7).place, Place::unknown);
  EXPECT_EQ(drive->full_name()->text, "robot/drive");
  EXPECT_EQ(inbox_.queues(), 2u);
}

TEST_F(AcceptedTableTest, AGroupThatTheHubMayHaveJustGivenIsNotThereYet) {
  const auto drive = table_.add("robot", "drive", {});
  EXPECT_EQ(table_.find(5).place, Place::not_yet);
  EXPECT_EQ(table_.on_own_service_moved("drive", {0, 5}), Place::not_yet);
  table_.place(drive, 5);
  EXPECT_EQ(table_.find(5).service, drive);
  EXPECT_EQ(table_.find(6).place, Place::unknown);
}

TEST_F(AcceptedTableTest, WhatStillComesForAServiceThatEndedIsUnwanted) {
  auto drive = add("drive", 5);
  table_.remove(drive);
  drive.reset();
  EXPECT_EQ(table_.find(5).place, Place::unwanted);
  EXPECT_EQ(inbox_.queues(), 0u);
  add("drive", 5);
  EXPECT_EQ(table_.find(5).place, Place::found);
}

TEST_F(AcceptedTableTest, AServiceMovesToAnotherGroup) {
  const auto drive = add("drive", 5);
  EXPECT_EQ(table_.on_own_service_moved("stop", {5, 6}), Place::unknown);
  EXPECT_EQ(table_.on_own_service_moved("drive", {4, 6}), Place::unknown);
  EXPECT_EQ(table_.on_own_service_moved("drive", {5, 6}), Place::found);
  EXPECT_EQ(table_.find(5).place, Place::unknown);
  EXPECT_EQ(table_.find(6).service, drive);
}

TEST_F(AcceptedTableTest, AServiceThatTheHubDoesNotTakeAgainSaysWhy) {
  const auto drive = add("drive", 5);
  EXPECT_TRUE(drive->standing());
  const Failure refusal{Status::limit, "the hub has too many"};
  EXPECT_EQ(table_.on_own_service_moved("drive", {5, 0, refusal}), Place::found);
  EXPECT_TRUE(drive->standing().is(Status::limit));
  EXPECT_EQ(drive->standing().failure().sentence,
            "cannot accept robot/drive: the hub did not take the service again, after a break or "
            "another name: the hub has too many");
  EXPECT_EQ(table_.on_own_service_moved("drive", {0, 7}), Place::found);
  EXPECT_TRUE(drive->standing());
  EXPECT_EQ(table_.find(7).service, drive);
  table_.end(gimi::Ending::closed());
  EXPECT_TRUE(drive->standing().is(Status::closed));
  EXPECT_TRUE(table_.add("robot", "stop", {})->standing().is(Status::closed));
}

class AcceptedServices : public testing::Test {
 protected:
  /// And waits until it was taken.
  Outcome<void> send(const std::string& service, const std::string& text) {
    const auto sender = viewer_.sender(service, {.window = 4});
    if (!sender) return sender.failure();
    if (const auto sent = sender->send(text, kWait); !sent) return sent;
    return sender->settle(kWait);
  }
  HubProcess hub_;
  std::optional<Node> robot_{Node("robot", hub_.url())};
  Node viewer_{"", hub_.url()};
};

TEST_F(AcceptedServices, EachOfANodeHasMessagesOfItsOwn) {
  const Accepted drive = robot_->accept("drive").or_throw();
  const Accepted stop = robot_->accept("stop").or_throw();
  send("robot/drive", "v 0.5").or_throw();
  send("robot/stop", "now").or_throw();
  viewer_.send(robot_->peer(), "to the node").or_throw();
  const Message ordered = stop.receive(kWait).or_throw();
  EXPECT_EQ(ordered.text(), "now");
  EXPECT_EQ(ordered.service(), "robot/stop");
  const Message speed = drive.receive(kWait).or_throw();
  EXPECT_EQ(speed.text(), "v 0.5");
  EXPECT_EQ(speed.service(), "robot/drive");
  const Message direct = robot_->receive(MessageKey{}, kWait).or_throw();
  EXPECT_EQ(direct.text(), "to the node");
  EXPECT_EQ(direct.service(), "");
  EXPECT_EQ(drive.size() + stop.size(), 0u);
}

TEST_F(AcceptedServices, OneEndsWithItsLastCopy) {
  std::optional<Accepted> drive = robot_->accept("drive").or_throw();
  std::optional<Queue> copy = *drive;
  send("robot/drive", "1").or_throw();
  drive.reset();
  send("robot/drive", "2").or_throw();
  EXPECT_EQ(copy->size(), 2u);
  copy.reset();
  EXPECT_TRUE(viewer_.services("robot/*").or_throw().empty());
  EXPECT_TRUE(eventually([&] { return send("robot/drive", "3").is(Status::not_found); }));
  // Another one of that name is a new one.
  drive = robot_->accept("drive").or_throw();
  EXPECT_TRUE(robot_->accept("drive").is(Status::taken));
  EXPECT_TRUE(eventually([&] { return send("robot/drive", "4").ok(); }));
  EXPECT_EQ(drive->receive(kWait).or_throw().text(), "4");
}

TEST_F(AcceptedServices, ItsMessagesHaveTheNameUnderWhichItWasSentTo) {
  const Accepted drive = robot_->accept("drive").or_throw();
  EXPECT_EQ(drive.name(), "robot/drive");
  robot_->take_name("forklift", kWait).or_throw();
  EXPECT_EQ(drive.name(), "forklift/drive");
  EXPECT_TRUE(eventually([&] { return viewer_.send("forklift/drive", "1").ok(); }));
  EXPECT_EQ(drive.receive(kWait).or_throw().service(), "forklift/drive");
  EXPECT_TRUE(drive.standing());
  robot_.reset();
  EXPECT_TRUE(drive.standing().is(Status::closed));
  EXPECT_TRUE(drive.receive(kWait).is(Status::closed));
}

}  // namespace
}  // namespace gimnet
