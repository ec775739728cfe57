// Tests the choice of the stranger that has to go when a waiting room is full, or when there are no
// descriptors.

#include "hub/control/waiting_room.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "tests/hub/control/support/waiting_room_rig.hpp"

namespace gimnet::hub {
namespace {

using namespace std::chrono_literals;
using proto::GoodbyeCode;
using ::testing::HasSubstr;
using ::testing::IsEmpty;

TEST_F(WaitingRoomTest, AtTheLimitTheOldestGoes) {
  limits_.handshakes = 3;
  Peer& oldest = enter(0ms);
  for (int i = 1; i < 3; ++i) enter(1ms);
  EXPECT_EQ(room_.waiting(), 3u);
  EXPECT_FALSE(oldest.receive_goodbye());
  enter(2ms);
  EXPECT_EQ(room_.waiting(), 3u);
  const auto goodbye = oldest.receive_goodbye();
  ASSERT_TRUE(goodbye);
  EXPECT_EQ(goodbye->code, GoodbyeCode::hello_timeout);
}

TEST_F(WaitingRoomTest, WhoseHelloIsThereByNowDoesNotMakeWay) {
  limits_.handshakes = 2;
  enter().send(opening_and(hello("robot")));
  Peer& second = enter();
  enter();
  EXPECT_EQ(admitted_.size(), 1u);
  EXPECT_FALSE(timed_out(second));
  EXPECT_EQ(room_.waiting(), 2u);
  second.close();
  enter();
  EXPECT_EQ(room_.waiting(), 2u);
  EXPECT_EQ(refusals_.of(GoodbyeCode::hello_timeout), 0u);
}

TEST_F(WaitingRoomTest, AtTheLimitOfAnAddressItsOldestGoes) {
  ASSERT_EQ(limits_.handshakes_per_address, 128u);
  for (const char* address : {"10.0.0.1", "[fe80::1]", "[::ffff:10.0.0.3]"}) {
    Peer& other = enter_from("10.0.0.2");
    Peer& oldest = enter_from(address);
    Peer& second = enter_from(address);
    for (int i = 2; i < 128; ++i) enter_from(address);
    const std::size_t waiting = room_.waiting();
    EXPECT_FALSE(timed_out(oldest)) << "at the limit";
    enter_from(address);
    EXPECT_EQ(room_.waiting(), waiting);
    const auto goodbye = oldest.receive_goodbye();
    ASSERT_TRUE(goodbye);
    EXPECT_EQ(goodbye->code, GoodbyeCode::hello_timeout);
    EXPECT_THAT(goodbye->sentence, HasSubstr("handshakes_per_address is 128"));
    EXPECT_FALSE(timed_out(second));
    EXPECT_FALSE(timed_out(other)) << "of another address";
  }
  EXPECT_EQ(refusals_.of(GoodbyeCode::hello_timeout), 3u);
}

TEST_F(WaitingRoomTest, WhoWaitsNoMoreHasNoPlaceOfItsAddress) {
  limits_.handshakes_per_address = 1;
  enter_from("10.0.0.1").send(opening_and(hello("robot")));
  serve();
  enter_from("10.0.0.1").send(opening_and(hello("unwelcome")));
  serve();
  enter_from("10.0.0.1").send("GET / HTTP/1.1\r\n");
  serve();
  enter_from("10.0.0.1").close();
  serve();
  enter_from("10.0.0.1", 1s);
  room_.tick(6s);
  EXPECT_EQ(refusals_.of(GoodbyeCode::hello_timeout), 1u) << "its own time was over";
  enter_from("10.0.0.1", 6s);
  while (room_.give_way_to(Stranger{}) != Acceptor::Room::none) {
  }
  EXPECT_EQ(room_.waiting(), 0u);
  Peer& last = enter_from("10.0.0.1", 7s);
  EXPECT_EQ(refusals_.of(GoodbyeCode::hello_timeout), 1u);
  enter_from("10.0.0.1", 7s);
  EXPECT_TRUE(timed_out(last));
}

TEST_F(WaitingRoomTest, ManyOfOneAddressWhoSayHelloAtOnceAllGetIn) {
  for (int i = 0; i < 300; ++i)
    enter_from("10.0.0.1").send(opening_and(hello("robot-" + std::to_string(i))));
  serve();
  EXPECT_EQ(admitted_.size(), 300u);
  EXPECT_EQ(refusals_.of(GoodbyeCode::hello_timeout), 0u);
}

TEST_F(WaitingRoomTest, ARobotsProgramsWhoseConnectionsAreThereBeforeTheyRunAllGetIn) {
  std::vector<Peer*> programs;
  for (int i = 0; i < 100; ++i) programs.push_back(&enter_from("10.0.0.1"));
  for (std::size_t i = 0; i < programs.size(); ++i)
    programs[i]->send(opening_and(hello("p-" + std::to_string(i))));
  serve();
  EXPECT_EQ(admitted_.size(), 100u);
  EXPECT_EQ(refusals_.of(GoodbyeCode::hello_timeout), 0u);
}

TEST_F(WaitingRoomTest, ThisMachinesOwnConnectionsAreNotCountedByAddress) {
  limits_.handshakes_per_address = 1;
  for (int i = 0; i < 20; ++i) {
    enter();
    for (const char* address : {"127.0.0.1", "127.9.9.9", "[::1]", "[::ffff:127.0.0.1]"})
      enter_from(address);
  }
  EXPECT_EQ(room_.waiting(), 100u);
}

TEST_F(WaitingRoomTest, ALowerLimitOfAnAddressHoldsFromTheNextOneOn) {
  for (int i = 0; i < 10; ++i) enter_from("10.0.0.1");
  limits_.handshakes_per_address = 3;
  enter_from("10.0.0.1");
  EXPECT_EQ(room_.waiting(), 3u);
}

TEST_F(WaitingRoomTest, TenThousandSilentConnectionsKeepToTheLimit) {
  limits_.handshakes = 100;
  for (int i = 0; i < 10'000; ++i) {
    enter(std::chrono::milliseconds{i / 10});
    ASSERT_LE(room_.waiting(), 100u);
    ASSERT_LE(room_.leaving(), 100u);
    if (peers_.size() > 300) peers_.erase(peers_.begin());
    serve(std::chrono::milliseconds{i / 10});
  }
  Peer& late = enter(1s);
  late.send(opening_and(hello("robot")));
  serve(1s);
  EXPECT_EQ(admitted_.size(), 1u);
  room_.tick(1h);
  EXPECT_EQ(room_.waiting(), 0u);
  room_.tick(2h);
  EXPECT_EQ(room_.waiting() + room_.leaving(), 0u);
}

TEST_F(WaitingRoomTest, WithoutDescriptorsWhoLeavesMakesWayAndThenTheOldest) {
  Peer& oldest = enter();
  Peer& younger = enter();
  Peer& told = enter();
  told.send(opening_and(hello("unwelcome")));
  serve();
  const Stranger newcomer;
  EXPECT_EQ(room_.give_way_to(newcomer), Acceptor::Room::ordinary);
  EXPECT_EQ(room_.leaving(), 0u);
  EXPECT_EQ(room_.waiting(), 2u);
  EXPECT_EQ(room_.give_way_to(newcomer), Acceptor::Room::ordinary);
  EXPECT_EQ(room_.waiting(), 1u);
  const auto goodbye = oldest.receive_goodbye();
  EXPECT_EQ(goodbye ? goodbye->code : GoodbyeCode::done, GoodbyeCode::no_memory);
  EXPECT_TRUE(oldest.closed());
  EXPECT_EQ(refusals_.no_descriptor.value(), 1u);
  younger.send(opening_and(hello("robot")));
  serve();
  EXPECT_EQ(admitted_.size(), 1u);
  EXPECT_EQ(room_.give_way_to(newcomer), Acceptor::Room::none);
}

TEST_F(WaitingRoomTest, WithoutDescriptorsAdministratorsMakeWayForTheirLikeOnly) {
  enter_as({.may_administer = true, .on_reserve = true});
  Peer& told = enter_as({.may_administer = true, .on_reserve = true});
  told.send(opening_and(hello("a node")));
  serve();
  EXPECT_THAT(hellos_, IsEmpty()) << "who is no administrator has no place there";
  const auto goodbye = told.receive_goodbye();
  EXPECT_EQ(goodbye ? goodbye->code : GoodbyeCode::done, GoodbyeCode::no_memory);
  EXPECT_EQ(refusals_.no_descriptor.value(), 1u);
  EXPECT_EQ(refusals_.of(GoodbyeCode::no_memory), 0u);
  const Stranger newcomer;
  EXPECT_EQ(room_.give_way_to(newcomer), Acceptor::Room::none);
  Stranger administrator;
  administrator.rights.administer = true;
  EXPECT_EQ(room_.give_way_to(administrator), Acceptor::Room::reserved);
  EXPECT_EQ(room_.leaving(), 0u);
  enter();
  EXPECT_EQ(room_.give_way_to(administrator), Acceptor::Room::ordinary) << "others before its like";
  EXPECT_EQ(room_.give_way_to(administrator), Acceptor::Room::reserved);
  EXPECT_EQ(room_.give_way_to(administrator), Acceptor::Room::none);
}

TEST_F(WaitingRoomTest, AnAdministratorOnTheReserveIsJudged) {
  proto::Hello wanted = hello("");
  wanted.role = proto::Role::admin;
  enter_as({.may_administer = true, .on_reserve = true}).send(opening_and(wanted));
  serve();
  EXPECT_EQ(admitted_.size(), 1u);
}

}  // namespace
}  // namespace gimnet::hub
