#include "proto/control/ns_watch.hpp"

#include <gtest/gtest.h>

#include "tests/proto/control/support/ns_vectors.hpp"

namespace gimnet::proto::ns {
namespace {

constexpr std::uint64_t kEpoch = 0x1122334455667788;

WatchEvents events_of_the_vector() {
  WatchEvents events;
  events.watch = 1;
  events.hub = HubId{7};
  events.epoch = kEpoch;
  events.after = 41;
  events.version = 43;
  events.changes.resize(3);
  events.changes[0].kind = ChangeKind::begin;
  events.changes[0].version = 41;
  events.changes[1].kind = ChangeKind::renamed;
  events.changes[1].version = 42;
  events.changes[1].former_name = "robot/old";
  events.changes[1].node = NodeRecord{NodeId{0x00700012}, "robot/base",      HubId{7}, "lab", true,
                                      "a robot",          "127.0.0.1:40000", 1500,     2};
  events.changes[2].kind = ChangeKind::withdrawn;
  events.changes[2].version = 43;
  events.changes[2].service.emplace();
  events.changes[2].service->group = GroupId{0x00700005};
  events.changes[2].service->name = "robot/odom";
  events.changes[2].service->node = NodeId{0x00700012};
  return events;
}

TEST(NsWatchMessages, AreDecodedAndWrittenAsTheVectorsSay) {
  test::expect_request("ns/watch", 11, Watch{1, "robot/**", kWatchServices, kEpoch, 40});
  test::expect_answer("ns/watch_answer", 11, WatchAnswer{true});
  test::expect_request("ns/unwatch", 12, Unwatch{1});
  test::expect_answer("ns/unwatch_answer", 12, UnwatchAnswer{});
  test::expect_request("ns/watch_taken", 13, WatchTaken{1, 2});
  test::expect_answer("ns/watch_taken_answer", 13, WatchTakenAnswer{});
  test::expect_request("ns/watch_events", 0, events_of_the_vector());
}

TEST(NsWatchMessages, RefuseSubjectsThatAHubDoesNotKnow) {
  for (const int subjects : {0, 4, 255}) {
    bitestream::Writer body;
    body.put_u32(3, 1);
    body.put_u8(5, static_cast<std::uint8_t>(subjects));
    EXPECT_FALSE(decode<Watch>(assemble_control({Watch::kOperation, 1}, body))) << subjects;
  }
}

TEST(NsWatchMessages, AChangeIsAboutOneThing) {
  bitestream::Writer body;
  body.begin_nested(3);
  body.put_u8(1, 3);
  for (const std::uint32_t key : {4u, 5u}) {
    body.begin_nested(key);
    body.put_u32(1, 7);
    body.end_nested();
  }
  body.end_nested();
  body.put_u32(4, 1);
  EXPECT_FALSE(decode<WatchEvents>(assemble_control({WatchEvents::kOperation, 0}, body)));
}

TEST(NsWatchMessages, TakeAKindOfChangeThatIsNotKnownYet) {
  WatchEvents events = events_of_the_vector();
  events.changes[2].kind = static_cast<ChangeKind>(99);
  const auto decoded = decode<WatchEvents>(encode(events));
  ASSERT_TRUE(decoded);
  EXPECT_EQ(*decoded, events);
}

TEST(NsWatchMessages, NeedWhatTheyAreAbout) {
  EXPECT_FALSE(decode<Watch>(test::from_hex("06 00 01 00")));
  EXPECT_FALSE(decode<Unwatch>(test::from_hex("0c 00 01 00")));
  EXPECT_FALSE(decode<WatchEvents>(test::from_hex("25 00 00 00")));
}

}  // namespace
}  // namespace gimnet::proto::ns
