#pragma once

#include <gtest/gtest.h>

#include <cstdint>
#include <string>
#include <vector>

#include "hub/data/fanout/pacer.hpp"
#include "tests/hub/data/support/route_rig.hpp"

// One paced subscription of group 7#5 at a time, and what goes into its outbox.

namespace gimnet::hub::testing {

using proto::DropReason;

inline constexpr GroupId kGroup{7u << 20 | 5};
inline constexpr std::uint64_t kStartMs = 1'000'000;

class PacerTest : public ::testing::Test {
 protected:
  PacerTest() { rig.egress.context.now_ms = kStartMs; }
  void TearDown() override { EXPECT_TRUE(rig.ledger_exact()); }

  PacedSubscription& subscribe(const PaceTerms& terms) {
    return rig.pacer.subscribe(recipient, kGroup, terms);
  }
  void offer(PacedSubscription& subscription, const std::vector<std::string>& texts,
             std::uint8_t lane = 1, std::uint8_t flags = 0) {
    const TestFrame frame{.kind = proto::Kind::group, .flags = flags, .lane = lane};
    const hub::Run run = rig.make_run(kGroup.value(), texts, frame);
    rig.pacer.begin_run(run, testing::last_bytes_of(run));
    EXPECT_TRUE(rig.pacer.offer(subscription, run, run.header(), {}));
  }
  hub::Run fragment(std::uint32_t number, std::uint32_t offset, std::uint32_t total,
                    const std::string& text, std::uint8_t lane) {
    std::string all(proto::kFragmentHeaderSize, '\0');
    proto::store_fragment_header(reinterpret_cast<std::byte*>(all.data()), {number, offset, total});
    const TestFrame frame{.kind = proto::Kind::group, .flags = proto::kFlagFragment, .lane = lane};
    return rig.make_run(kGroup.value(), {all + text}, frame);
  }
  void offer_fragment(PacedSubscription& subscription, std::uint32_t number, std::uint32_t offset,
                      std::uint32_t total, const std::string& text, std::uint8_t lane = 1) {
    const hub::Run run = fragment(number, offset, total, text, lane);
    EXPECT_TRUE(rig.pacer.offer(subscription, run, run.header(), {}));
  }
  /// The texts that went into the outbox since the last call.
  std::vector<std::string> sent() {
    std::vector<std::string> texts;
    for (std::size_t lane = 0; lane < proto::kLaneCount; ++lane) {
      LaneQueue& queue = recipient.outbox.lane(lane);
      while (!queue.empty()) {
        Entry& entry = queue.front();
        do {
          for (hub::Run rest = entry.run.share(); rest.frames != 0; rest.skip_frame()) {
            std::size_t skip = proto::kHeaderSize;
            if (rest.header().has(proto::kFlagFragment)) skip += proto::kFragmentHeaderSize;
            texts.emplace_back(reinterpret_cast<const char*>(rest.bytes) + skip,
                               rest.header().frame_size() - skip);
          }
        } while (entry.next_piece());
        rig.egress.tally.queued -= entry.frames;
        rig.egress.tally.delivered += entry.frames;
        queue.on_left(entry, entry.size);
        queue.pop_front();
      }
    }
    return texts;
  }
  void pass_ms(std::uint64_t ms) {
    rig.egress.context.now_ms += ms;
    rig.pacer.release_due();
  }
  std::uint64_t dropped(DropReason reason) { return rig.egress.dropped(reason); }

  RouteRig rig;
  Recipient& recipient = rig.add_here(2);
};

}  // namespace gimnet::hub::testing
