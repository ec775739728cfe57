#include "hub/data/egress/pause_book.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "hub/data/egress/source_bytes.hpp"
#include "tests/hub/data/support/egress_rig.hpp"

namespace gimnet::hub {
namespace {

using ::testing::ElementsAre;
using testing::FakeSignals;
using ::testing::IsEmpty;

constexpr NodeId kOne{7u << 20 | 1};
constexpr NodeId kTwo{7u << 20 | 2};
const proto::flow::Target kNormal{proto::Kind::unicast, proto::Lane::normal, 99};
const proto::flow::Target kBulk{proto::Kind::unicast, proto::Lane::bulk, 99};

TEST(PauseBook, PausesOncePerSenderAndTarget) {
  FakeSignals signals;
  PauseBook book;
  EXPECT_TRUE(book.empty());
  book.on_full(kOne, kNormal, 100, false, signals);
  book.on_full(kOne, kNormal, 100, false, signals);
  book.on_full(kTwo, kNormal, 100, false, signals);
  book.on_full(kOne, kBulk, 100, false, signals);
  EXPECT_THAT(signals.take(), ElementsAre("pause 1", "pause 2", "pause 1"));
  book.on_room(proto::Lane::normal, ~0u, signals);
  EXPECT_THAT(signals.take(), ElementsAre("resume 1", "resume 2"));
  EXPECT_FALSE(book.empty());
  book.on_room(proto::Lane::bulk, ~0u, signals);
  EXPECT_THAT(signals.take(), ElementsAre("resume 1"));
  EXPECT_TRUE(book.empty());
}

TEST(PauseBook, GivesRoomToThoseOfAPlace) {
  FakeSignals signals;
  PauseBook book;
  book.on_full(kOne, kNormal, 100, false, signals);
  book.on_full(kTwo, kNormal, 100, false, signals);
  EXPECT_TRUE(book.pauses(static_cast<std::size_t>(proto::Lane::normal)));
  signals.take();
  book.on_room(proto::Lane::normal, 1u << SourceBytes::place_of(kTwo), signals);
  EXPECT_THAT(signals.take(), ElementsAre("resume 2"));
  book.on_room(proto::Lane::normal, 1u << SourceBytes::place_of(kTwo), signals);
  EXPECT_THAT(signals.take(), IsEmpty());
  book.on_room(proto::Lane::normal, 1u << SourceBytes::place_of(kOne), signals);
  EXPECT_THAT(signals.take(), ElementsAre("resume 1"));
  EXPECT_FALSE(book.pauses(static_cast<std::size_t>(proto::Lane::normal)));
}

TEST(PauseBook, SaysAgainWhatIsAboutAnotherHub) {
  FakeSignals signals;
  PauseBook book;
  const proto::flow::Target here{proto::Kind::unicast, proto::Lane::normal, 7u << 20 | 99};
  const proto::flow::Target away{proto::Kind::unicast, proto::Lane::normal, 8u << 20 | 99};
  book.on_full(kOne, here, 100, false, signals);
  book.on_full(kTwo, away, 100, false, signals);
  signals.take();
  book.say_again(signals);
  EXPECT_THAT(signals.take(), ElementsAre("pause 2"));
}

// A long way holds much until PAUSE works, and a link is never held.
TEST(PauseBook, TakesFromOtherHubsAsMuchAsTheOutboxMayHoldAndTheReserves) {
  testing::EgressRig rig;
  PauseBook book;
  proto::FrameHeader header;
  header.src = 8u << 20 | 1;
  header.dst = 7u << 20 | 99;
  const std::uint64_t reserve = rig.limits.reserve_bytes;
  const auto takes = [&](std::uint64_t bytes, std::uint64_t held_most) {
    return book.ask(header, 100, {bytes, reserve, bytes, held_most}, rig.context);
  };
  EXPECT_TRUE(takes(20 * reserve, 20 * reserve));
  EXPECT_FALSE(takes(20 * reserve + 1, 20 * reserve));
  EXPECT_TRUE(takes(8 * reserve, 0)) << "memory is scarce";
  EXPECT_FALSE(takes(8 * reserve + 1, 0));
  book.release_all(rig.signals);
}

TEST(PauseBook, HoldsOnceAndReleasesAsOften) {
  FakeSignals signals;
  PauseBook book;
  book.on_full(kOne, kNormal, 100, false, signals);
  book.on_full(kOne, kNormal, 100, true, signals);
  book.on_full(kOne, kNormal, 100, true, signals);
  EXPECT_THAT(signals.take(), ElementsAre("pause 1", "hold 1"));
  book.release_all(signals);
  EXPECT_THAT(signals.take(), ElementsAre("resume 1", "release 1"));
  book.release_all(signals);
  EXPECT_THAT(signals.take(), IsEmpty());
}

TEST(PauseBook, CountsWhatComesFromAHeldSender) {
  FakeSignals signals;
  PauseBook book;
  EXPECT_EQ(book.on_full(kOne, kNormal, 100, false, signals), 0u);
  EXPECT_EQ(book.on_full(kOne, kNormal, 100, true, signals), 100u);
  EXPECT_EQ(book.on_full(kOne, kNormal, 20, true, signals), 120u);
  EXPECT_EQ(book.on_full(kTwo, kNormal, 3, true, signals), 3u) << "of another one";
  book.on_room(proto::Lane::normal, ~0u, signals);
  EXPECT_EQ(book.on_full(kOne, kNormal, 5, true, signals), 5u) << "held anew";
}

TEST(PauseBook, RemindsAt256KiBAndNotBefore) {
  FakeSignals signals;
  PauseBook book;
  book.on_full(kOne, kNormal, 1, false, signals);
  signals.take();
  book.on_full(kOne, kNormal, 256 * 1024 - 1, false, signals);
  EXPECT_THAT(signals.take(), IsEmpty());
  book.on_full(kOne, kNormal, 1, false, signals);
  EXPECT_THAT(signals.take(), ElementsAre("pause 1"));
}

}  // namespace
}  // namespace gimnet::hub
