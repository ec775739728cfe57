#include "client/nif/send_queue.hpp"

#include <gtest/gtest.h>

#include <cstring>
#include <string>
#include <vector>

#include "tests/client/nif/support/frames.hpp"

namespace gimnet::nif::test {
namespace {

TEST(SendQueue, WritesInOrderAndLowerLanesFirst) {
  SendQueue queue({});
  put(queue, NIF_BULK, "bulk");
  put(queue, NIF_NORMAL, "a");
  put(queue, NIF_NORMAL, "b");
  put(queue, NIF_REAL_TIME, "first");
  EXPECT_EQ(payloads(write_all(queue)), (std::vector<std::string>{"first", "a", "b", "bulk"}));
  EXPECT_TRUE(queue.all_written());
  EXPECT_EQ(queue.frames_written(), 4u);
}

TEST(SendQueue, NeighbouringFramesAreOnePiece) {
  SendQueue queue({});
  for (int i = 0; i < 1000; ++i) put(queue, NIF_NORMAL, "x");
  EXPECT_EQ(queue.gather().size(), 1u);
}

TEST(SendQueue, ControlFramesGoBeforeAllLanes) {
  SendQueue queue({});
  put(queue, NIF_REAL_TIME, "data");
  put_control(queue, "control");
  EXPECT_EQ(payloads(write_all(queue)), (std::vector<std::string>{"control", "data"}));
  EXPECT_EQ(queue.frames_written(), 1u) << "control frames are not counted";
}

TEST(SendQueue, ShortWritesLoseNothingAtAnyCut) {
  for (std::size_t cut = 1; cut < 80; ++cut) {
    SendQueue queue({});
    put(queue, NIF_NORMAL, "one");
    put(queue, NIF_BULK, "two");
    put_control(queue, "zero");
    EXPECT_EQ(payloads(write_all(queue, cut)), (std::vector<std::string>{"zero", "one", "two"}))
        << cut;
  }
}

TEST(SendQueue, UrgentFramesOvertakeWhatAShortWriteLeft) {
  SendQueue queue({});
  for (int i = 0; i < 4; ++i) put(queue, NIF_BULK, "bulk" + std::to_string(i));
  std::vector<std::byte> written =
      write_once(queue, 25);  // one frame has 21 bytes: the second is begun
  put(queue, NIF_REAL_TIME, "now");
  put_control(queue, "control");
  append(written, write_all(queue));
  EXPECT_EQ(payloads(written),
            (std::vector<std::string>{"bulk0", "bulk1", "control", "now", "bulk2", "bulk3"}));
}

TEST(SendQueue, AWaitingLaneGetsASixteenth) {
  SendQueue queue({.queue_bytes = 64u << 20, .retained_bytes = 0});
  const std::string kilobyte(1008, 'u');
  for (int i = 0; i < 2048; ++i) put(queue, NIF_REAL_TIME, kilobyte);
  for (int i = 0; i < 512; ++i) put(queue, NIF_BACKGROUND, std::string(1008, 'b'));
  std::size_t urgent = 0;
  std::size_t background = 0;
  for (const std::string& payload : payloads(write_once(queue, 256 * 1024))) {
    (payload[0] == 'u' ? urgent : background) += payload.size();
  }
  EXPECT_GT(background, 0u);
  EXPECT_LE(background * 14, urgent);
}

TEST(SendQueue, HasRoomUpToItsLimitAndForOneFrameOfAnySize) {
  SendQueue queue({.queue_bytes = 100, .retained_bytes = 0});
  EXPECT_TRUE(queue.has_room(1'000'000));
  put(queue, NIF_NORMAL, std::string(64, 'x'));  // 80 bytes with the header
  EXPECT_TRUE(queue.has_room(20));
  EXPECT_FALSE(queue.has_room(21));
}

TEST(SendQueue, LatestTakesThePlaceOfTheOlderOneOfItsStream) {
  SendQueue queue({});
  put_latest(queue, "old one", 1);
  put(queue, NIF_NORMAL, "between");
  put_latest(queue, "other", 2);
  put_latest(queue, "new", 1);
  EXPECT_EQ(queue.frames_replaced(), 1u);
  EXPECT_EQ(payloads(write_all(queue)), (std::vector<std::string>{"new", "between", "other"}));
  EXPECT_EQ(queue.unsent_bytes(), 0u);
  put_latest(queue, "next", 1);
  EXPECT_EQ(queue.frames_replaced(), 1u) << "what was written is not replaced";
  EXPECT_EQ(payloads(write_all(queue)), (std::vector<std::string>{"next"}));
}

TEST(SendQueue, KeepsWhatIsUnconfirmedAndSendsItAgain) {
  SendQueue queue({});
  queue.set_resume(true);
  for (const char* text : {"0", "1", "2", "3"}) put(queue, NIF_NORMAL, text);
  static_cast<void>(write_all(queue));
  EXPECT_TRUE(queue.confirm(1));
  queue.disconnect();
  put(queue, NIF_REAL_TIME, "urgent");
  EXPECT_EQ(queue.resume_from(2), 0u);
  EXPECT_EQ(payloads(write_all(queue)), (std::vector<std::string>{"2", "3", "urgent"}))
      << "what was counted goes first, whatever its lane";
  EXPECT_EQ(queue.frames_resent(), 2u);
  EXPECT_EQ(queue.frames_written(), 5u);
  EXPECT_TRUE(queue.confirm(5));
  EXPECT_EQ(queue.retained_bytes(), 0u);
  EXPECT_FALSE(queue.confirm(6)) << "more than were written";
}

TEST(SendQueue, AFrameCutByABreakIsSentAgainFromItsStart) {
  for (std::size_t cut = 0; cut < 60; ++cut) {
    SendQueue queue({});
    queue.set_resume(true);
    for (const char* text : {"zero", "one", "two"}) put(queue, NIF_BULK, text);
    const std::size_t whole = payloads(write_once(queue, cut)).size();
    put_control(queue, "goes with the connection");
    queue.disconnect();
    ASSERT_EQ(queue.resume_from(whole), 0u);
    std::vector<std::string> expected{"zero", "one", "two"};
    expected.erase(expected.begin(), expected.begin() + static_cast<std::ptrdiff_t>(whole));
    EXPECT_EQ(payloads(write_all(queue, 7)), expected) << cut;
  }
}

TEST(SendQueue, ASecondBreakDuringResendingKeepsTheOrder) {
  SendQueue queue({});
  queue.set_resume(true);
  for (int i = 0; i < 6; ++i) put(queue, NIF_NORMAL, std::to_string(i));
  static_cast<void>(write_all(queue));
  queue.disconnect();
  ASSERT_EQ(queue.resume_from(1), 0u);
  static_cast<void>(write_once(queue, 2 * 17 + 5));  // 1 and 2 whole, 3 begun
  queue.disconnect();
  ASSERT_EQ(queue.resume_from(2), 0u);
  put(queue, NIF_REAL_TIME, "6");
  EXPECT_EQ(payloads(write_all(queue)), (std::vector<std::string>{"2", "3", "4", "5", "6"}));
}

TEST(SendQueue, LetsUnblockingFramesGoAndSaysHowMany) {
  SendQueue queue({.queue_bytes = 1000, .retained_bytes = 100});
  queue.set_resume(true);
  for (int i = 0; i < 10; ++i) {
    ASSERT_TRUE(queue.has_room(20)) << i;
    put(queue, NIF_NORMAL, "drop", proto::Policy::drop);
    static_cast<void>(write_all(queue));
  }
  EXPECT_EQ(queue.frames_let_go(), 5u);
  queue.disconnect();
  EXPECT_EQ(queue.resume_from(2), 3u) << "frames 2, 3 and 4 are gone";
  EXPECT_EQ(payloads(write_all(queue)).size(), 5u);
}

TEST(SendQueue, WaitsForConfirmationOfBlockingFrames) {
  SendQueue queue({.queue_bytes = 1000, .retained_bytes = 100});
  queue.set_resume(true);
  for (int i = 0; i < 5; ++i) put(queue, NIF_NORMAL, "wait");
  static_cast<void>(write_all(queue));
  EXPECT_FALSE(queue.has_room(20));
  EXPECT_TRUE(queue.confirm(1));
  EXPECT_TRUE(queue.has_room(20));
  EXPECT_FALSE(queue.has_room(21));
}

TEST(SendQueue, RefusesAnImpossibleCount) {
  SendQueue queue({});
  queue.set_resume(true);
  put(queue, NIF_NORMAL, "a");
  static_cast<void>(write_all(queue));
  queue.disconnect();
  EXPECT_FALSE(queue.resume_from(2));
}

TEST(SendQueue, AConfirmationMayOvertakeTheWritersReturn) {
  SendQueue queue({});
  queue.set_resume(true);
  put(queue, NIF_NORMAL, "a");
  std::size_t bytes = 0;
  for (const iovec& piece : queue.gather()) bytes += piece.iov_len;
  EXPECT_TRUE(queue.confirm(1)) << "the hub was quicker than sendmsg()";
  queue.commit(bytes);
  EXPECT_EQ(queue.retained_bytes(), 0u);
}

TEST(SendQueue, ANewEpochKeepsWhatWaitsUnderTheNewId) {
  SendQueue queue({});
  queue.set_resume(true);
  put(queue, NIF_NORMAL, "gone");
  static_cast<void>(write_all(queue));
  put(queue, NIF_NORMAL, "kept");
  queue.disconnect();
  queue.restart(99);
  EXPECT_TRUE(queue.gather().empty()) << "nobody knows yet where the services are";
  EXPECT_EQ(queue.go_on({}), 0u);
  const auto written = write_all(queue);
  EXPECT_EQ(payloads(written), (std::vector<std::string>{"kept"}));
  EXPECT_EQ(proto::load_header(written.data()).src, 99u);
  EXPECT_TRUE(queue.confirm(1));
  EXPECT_FALSE(queue.confirm(2)) << "counts begin at 0";
}

/// Resumed, and broken again before what the hub had missed was written once more; then the hub has
/// forgotten it all.
TEST(SendQueue, ANewEpochAfterAResumeKeepsTheOrderOfEachLane) {
  SendQueue queue({});
  queue.set_resume(true);
  put(queue, NIF_BACKGROUND, "behind");
  static_cast<void>(write_all(queue));
  put(queue, NIF_NORMAL, "first");  // right behind it in memory, and in the resume buffer
  static_cast<void>(write_all(queue));
  queue.disconnect();
  ASSERT_EQ(queue.resume_from(0), 0u);
  put(queue, NIF_NORMAL, "second");
  queue.disconnect();
  queue.restart(99);
  EXPECT_EQ(queue.go_on({}), 0u);
  EXPECT_EQ(payloads(write_all(queue)), (std::vector<std::string>{"first", "second", "behind"}));
}

TEST(SendQueue, DropsEverything) {
  SendQueue queue({});
  queue.set_resume(true);
  put(queue, NIF_NORMAL, "retained");
  static_cast<void>(write_all(queue));
  put(queue, NIF_NORMAL, "waits");
  put_latest(queue, "latest", 1);
  EXPECT_EQ(queue.drop_all(), 2u);
  EXPECT_TRUE(queue.all_written());
  EXPECT_EQ(queue.retained_bytes(), 0u);
  EXPECT_TRUE(queue.gather().empty());
}

}  // namespace
}  // namespace gimnet::nif::test
