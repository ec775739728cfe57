#include "hub/control/waiting_room.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "tests/hub/control/support/waiting_room_rig.hpp"

namespace gimnet::hub {
namespace {

using namespace std::chrono_literals;
using proto::Goodbye;
using proto::GoodbyeCode;
using ::testing::IsEmpty;

TEST_F(WaitingRoomTest, WhoSaysHelloIsJudgedAndLeavesWithItsTransport) {
  Peer& peer = enter();
  peer.send(opening_and(hello("robot")));
  serve();
  ASSERT_EQ(admitted_.size(), 1u);
  EXPECT_EQ(hellos_[0].name, "robot");
  EXPECT_EQ(room_.waiting(), 0u);
  EXPECT_EQ(room_.next_deadline(), std::nullopt);
  EXPECT_THAT(peer.receive(), IsEmpty());
  EXPECT_FALSE(peer.closed());
}

TEST_F(WaitingRoomTest, WhoIsRefusedIsToldWhy) {
  Peer& peer = enter();
  peer.send(opening_and(hello("unwelcome")));
  serve();
  EXPECT_EQ(peer.receive_goodbye(), (Goodbye{GoodbyeCode::name_taken, "taken"}));
  EXPECT_TRUE(peer.closed());
  EXPECT_EQ(refusals_.of(GoodbyeCode::name_taken), 1u);
  EXPECT_EQ(room_.leaving(), 1u);
  peer.close();
  serve();
  EXPECT_EQ(room_.leaving(), 0u);
}

// A refusal makes room among those who leave: never by removing one whose own event is in the same
// batch.
TEST_F(WaitingRoomTest, WhoLeavesAndTalksInTheBatchOfARefusalIsServedOnce) {
  limits_.handshakes = 1;
  Peer& first = enter();
  first.send(opening_and(hello("unwelcome")));
  serve();
  Peer& second = enter();
  second.send(opening_and(hello("unwelcome")));
  first.send(std::vector<std::byte>(100));
  serve();
  EXPECT_EQ(room_.leaving(), 1u);
  EXPECT_EQ(second.receive_goodbye(), (Goodbye{GoodbyeCode::name_taken, "taken"}));
}

TEST_F(WaitingRoomTest, AHubThatIsRefusedAgainAndAgainIsLoggedEach10Seconds) {
  proto::Hello again = hello("unwelcome");
  again.role = proto::Role::hub;
  again.introduction.emplace();
  again.introduction->hub.hub = HubId{9};
  again.introduction->instance = proto::HubInstance{1};
  const auto logged = [&](std::chrono::milliseconds now) {
    testing::internal::CaptureStderr();
    enter_from("10.0.0.77", now).send(opening_and(again));
    serve(now);
    return testing::internal::GetCapturedStderr();
  };
  EXPECT_NE(logged(20s).find("refused tcp 10.0.0.77:"), std::string::npos);
  for (int i = 1; i < 20; ++i) EXPECT_EQ(logged(20s + i * 500ms), "");
  EXPECT_NE(logged(30s).find("(19 lines like this were left out)"), std::string::npos);
  EXPECT_EQ(refusals_.of(GoodbyeCode::name_taken), 21u);
}

TEST_F(WaitingRoomTest, WhoDoesNotCloseAfterGoodbyeIsClosed) {
  Peer& peer = enter();
  peer.send(opening_and(hello("unwelcome")));
  serve();
  room_.tick(999ms);
  EXPECT_EQ(room_.leaving(), 1u);
  EXPECT_EQ(room_.next_deadline(), 1s);
  room_.tick(1s);
  EXPECT_EQ(room_.leaving(), 0u);
}

TEST_F(WaitingRoomTest, TheTimeToLeaveIsALimit) {
  for (const auto& time : {0ms, 60'000ms}) {
    limits_.farewell_ms = static_cast<std::uint64_t>(time.count());
    enter(1s).send(opening_and(hello("unwelcome")));
    serve(1s);
    room_.tick(1s + time - 1ms);
    EXPECT_EQ(room_.leaving(), 1u);
    room_.tick(1s + time);
    EXPECT_EQ(room_.leaving(), 0u);
  }
}

TEST_F(WaitingRoomTest, WhoGoesOnTalkingAfterGoodbyeIsClosedBeforeItsTime) {
  Peer& peer = enter();
  peer.send(opening_and(hello("unwelcome")));
  serve();
  const std::vector<std::byte> noise(4'096);
  for (int i = 0; i < 17; ++i) {
    peer.send(noise);
    serve();
    if (room_.leaving() == 0) break;
  }
  EXPECT_EQ(room_.leaving(), 0u);
}

TEST_F(WaitingRoomTest, GarbageIsClosedWithoutAnAnswer) {
  Peer& peer = enter();
  peer.send("GET / HTTP/1.1\r\nHost: x\r\n\r\n");
  serve();
  EXPECT_THAT(peer.receive(), IsEmpty());
  EXPECT_TRUE(peer.closed());
  EXPECT_EQ(room_.waiting() + room_.leaving(), 0u);
  EXPECT_EQ(refusals_.garbage.value(), 1u);
}

TEST_F(WaitingRoomTest, WhoIsAdmittedOrLeavesByItselfIsNoRefusal) {
  enter().send(opening_and(hello("robot")));
  enter().close();
  serve();
  EXPECT_EQ(room_.waiting() + room_.leaving(), 0u);
  for (const Counter& counter : refusals_.by_code) EXPECT_EQ(counter.value(), 0u);
  EXPECT_EQ(refusals_.garbage.value(), 0u);
  EXPECT_EQ(refusals_.unfinished.value(), 0u);
}

TEST_F(WaitingRoomTest, CountsWhoEndsInTheMiddleOfOpeningOrHello) {
  const std::vector<std::byte> bytes = opening_and(hello("robot"));
  std::uint64_t ended = 0;
  for (const std::size_t size :
       {std::size_t{1}, proto::kOpeningSize, proto::kOpeningSize + 1, bytes.size() - 1}) {
    Peer& peer = enter();
    peer.send(std::span{bytes}.first(size));
    serve();
    EXPECT_EQ(refusals_.unfinished.value(), ended) << "it may go on";
    peer.close();
    serve();
    EXPECT_EQ(refusals_.unfinished.value(), ++ended) << size << " bytes";
  }
  EXPECT_EQ(room_.waiting() + room_.leaving(), 0u);
}

TEST_F(WaitingRoomTest, CountsWhoDoesNotSayHelloInTime) {
  enter();
  room_.tick(std::chrono::milliseconds{limits_.handshake_ms} - 1ms);
  EXPECT_EQ(refusals_.of(GoodbyeCode::hello_timeout), 0u);
  room_.tick(std::chrono::milliseconds{limits_.handshake_ms});
  EXPECT_EQ(refusals_.of(GoodbyeCode::hello_timeout), 1u);
}

TEST_F(WaitingRoomTest, HalfAHelloWaitsUntilItsDeadlineExactly) {
  Peer& peer = enter(1s);
  const std::vector<std::byte> bytes = opening_and(hello("robot"));
  peer.send(std::span{bytes}.first(bytes.size() / 2));
  serve(1s);
  EXPECT_EQ(room_.next_deadline(), 6s);
  room_.tick(6s - 1ms);
  EXPECT_EQ(room_.waiting(), 1u);
  room_.tick(6s);
  EXPECT_EQ(room_.waiting(), 0u);
  const auto goodbye = peer.receive_goodbye();
  ASSERT_TRUE(goodbye);
  EXPECT_EQ(goodbye->code, GoodbyeCode::hello_timeout);
}

TEST_F(WaitingRoomTest, AHelloThatDripsDoesNotMoveItsDeadline) {
  Peer& peer = enter();
  const std::vector<std::byte> bytes = opening_and(hello("robot"));
  for (std::size_t i = 0; i < 10; ++i) {
    peer.send(std::span{bytes}.subspan(i, 1));
    serve(std::chrono::milliseconds{400 * i});
  }
  room_.tick(5s);
  EXPECT_EQ(room_.waiting(), 0u);
}

TEST_F(WaitingRoomTest, WhoseHelloIsThereAtItsDeadlineIsJudged) {
  enter().send(opening_and(hello("robot")));
  Peer& half = enter();
  const std::vector<std::byte> bytes = opening_and(hello("late"));
  half.send(std::span{bytes}.first(bytes.size() / 2));
  enter().close();
  room_.tick(5s);
  EXPECT_EQ(admitted_.size(), 1u);
  EXPECT_TRUE(timed_out(half));
  EXPECT_EQ(room_.waiting(), 0u);
  EXPECT_EQ(refusals_.of(GoodbyeCode::hello_timeout), 1u);
}

TEST_F(WaitingRoomTest, WhoWaitsOrLeavesHasItsTimeAgainWhereTheHubStoodStill) {
  enter(0s);
  enter(1s).send(opening_and(hello("unwelcome")));
  serve(1s);  // it may leave until 2 s
  enter(61s);
  room_.stood_still(60s, 61s);
  EXPECT_EQ(room_.next_deadline(), 62s);
  room_.tick(62s - 1ms);
  EXPECT_EQ(room_.leaving(), 1u);
  room_.tick(62s);
  EXPECT_EQ(room_.leaving(), 0u);
  room_.tick(65s - 1ms);
  EXPECT_EQ(room_.waiting(), 2u);
  room_.tick(65s);
  EXPECT_EQ(room_.waiting(), 1u);
  EXPECT_EQ(room_.next_deadline(), 66s) << "what began after that has its time, and no more";
}

TEST_F(WaitingRoomTest, WhoHangsUpIsForgotten) {
  Peer& peer = enter();
  peer.close();
  serve();
  EXPECT_EQ(room_.waiting() + room_.leaving(), 0u);
}

// Many robots behind one address translator come back at once: none is sent away whose HELLO is
// there.
TEST_F(WaitingRoomTest, WhoIsSeenOffIsReadUntilItLeavesOrItsTimeIsOver) {
  peers_.push_back(std::make_unique<Peer>());
  Peer& patient = *peers_.back();
  peers_.push_back(std::make_unique<Peer>());
  Peer& hasty = *peers_.back();
  room_.see_off(patient.take_stranger().transport, 0ms);
  room_.see_off(hasty.take_stranger().transport, 0ms);
  EXPECT_EQ(room_.leaving(), 2u);
  patient.send("what was under way when the hub said GOODBYE");
  hasty.close();
  serve();
  EXPECT_EQ(room_.leaving(), 1u) << "who closes is gone at once";
  EXPECT_THAT(patient.receive(), IsEmpty());
  EXPECT_TRUE(patient.closed()) << "the hub's side is shut from the beginning";
  room_.tick(1h);
  EXPECT_EQ(room_.leaving(), 0u);
}

TEST_F(WaitingRoomTest, AtTheEndEverybodyIsDismissed) {
  Peer& a = enter();
  Peer& b = enter();
  room_.dismiss_all({GoodbyeCode::draining, "bye"}, 0ms);
  EXPECT_EQ(room_.waiting(), 0u);
  EXPECT_EQ(a.receive_goodbye()->code, GoodbyeCode::draining);
  EXPECT_EQ(b.receive_goodbye()->code, GoodbyeCode::draining);
}

TEST_F(WaitingRoomTest, AtTheEndAllWhoLeaveHaveTheirTime) {
  limits_.handshakes = 1;
  const auto see_off = [this] {
    peers_.push_back(std::make_unique<Peer>());
    room_.see_off(peers_.back()->take_stranger().transport, 0ms);
  };
  see_off();
  see_off();
  EXPECT_EQ(room_.leaving(), 1u);
  room_.dismiss_all({GoodbyeCode::draining, "bye"}, 0ms);
  for (int i = 0; i < 9; ++i) see_off();
  serve();
  EXPECT_EQ(room_.leaving(), 10u);
  room_.tick(1s);
  EXPECT_EQ(room_.leaving(), 0u);
}

}  // namespace
}  // namespace gimnet::hub
