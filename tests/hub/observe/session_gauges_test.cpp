#include "hub/observe/session_gauges.hpp"

#include <gtest/gtest.h>

namespace gimnet::hub {
namespace {

constexpr std::size_t kSlots = 4;

std::uint64_t total(const SessionCounts& counts) {
  return counts.queued_bytes + counts.accepted + counts.received_bytes + counts.delivered +
         counts.sent_bytes + counts.dropped + counts.queue_full;
}

TEST(SessionGauges, TellWhatASessionCameTo) {
  SessionGauges gauges(kSlots);
  SessionCounters& counters = gauges.begin(ConnectionSlot{kSlots - 1}, 7);
  SessionCounters& other = gauges.begin(ConnectionSlot{0}, 8);
  counters.accepted.add(1);
  counters.received_bytes.add(2);
  counters.delivered.add(3);
  counters.sent_bytes.store(4);
  counters.dropped.add(5);
  counters.queue_full.add(4);
  gauges.set_queued(ConnectionSlot{kSlots - 1}, 6);
  other.accepted.add(100);
  const SessionCounts counts = gauges.counts(ConnectionSlot{kSlots - 1}, 7);
  EXPECT_EQ(counts.accepted, 1u);
  EXPECT_EQ(counts.received_bytes, 2u);
  EXPECT_EQ(counts.delivered, 3u);
  EXPECT_EQ(counts.sent_bytes, 4u);
  EXPECT_EQ(counts.dropped, 5u);
  EXPECT_EQ(counts.queue_full, 4u);
  EXPECT_EQ(counts.queued_bytes, 6u);
  EXPECT_EQ(total(gauges.counts(ConnectionSlot{0}, 8)), 100u);
}

TEST(SessionGauges, TellNothingOfTheSessionBefore) {
  SessionGauges gauges(kSlots);
  const ConnectionSlot slot{1};
  EXPECT_EQ(total(gauges.counts(slot, 7)), 0u) << "not begun yet";
  gauges.begin(slot, 7).accepted.add(1);
  gauges.set_queued(slot, 6);
  EXPECT_EQ(total(gauges.counts(slot, 8)), 0u) << "the next one, which its shard does not know yet";
  SessionCounters& next = gauges.begin(slot, 8);
  EXPECT_EQ(total(gauges.counts(slot, 8)), 0u);
  next.dropped.add(2);
  EXPECT_EQ(total(gauges.counts(slot, 8)), 2u);
}

TEST(SessionGauges, SlotsBeyondTheLastAreCountedForNobody) {
  SessionGauges gauges(kSlots);
  const ConnectionSlot beyond{kSlots};
  gauges.begin(beyond, 7).accepted.add(1);
  gauges.set_queued(beyond, 6);
  EXPECT_EQ(total(gauges.counts(beyond, 7)), 0u);
  EXPECT_EQ(total(gauges.counts(ConnectionSlot{kSlots - 1}, 7)), 0u);
}

}  // namespace
}  // namespace gimnet::hub
