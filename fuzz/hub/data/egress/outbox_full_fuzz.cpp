// Bursts of several sources to a full outbox: it keeps and drops what docs/protocol.md, section 5,
// says, burst by burst. Input: choices, five bytes and more for each burst.

#include <cstddef>
#include <cstdint>
#include <string>
#include <vector>

#include "fuzz/support/fuzz_input.hpp"
#include "tests/hub/data/support/egress_rig.hpp"
#include "tests/hub/data/support/lane_rule.hpp"

namespace {

using namespace gimnet;
using namespace gimnet::hub;
using hub::testing::EgressRig;
using hub::testing::LaneRule;
using hub::testing::TestConnection;
using hub::testing::TestFrame;

constexpr std::uint64_t kLaneBytes = 2'000;
constexpr std::uint8_t kLane = 1;
constexpr std::uint8_t kBlock = 1;
constexpr std::uint8_t kDrop = 2;
/// So that fewer than 64 entries wait: at most 40 that may be dropped, and what is sent with BLOCK.
constexpr std::uint32_t kFrameBytesMin = 50;
constexpr int kBlockBurstsMax = 20;
constexpr int kBurstsMax = 200;

Limits limits() {
  Limits small;
  small.lane0_bytes = small.lane1_bytes = small.lane2_bytes = small.lane3_bytes = kLaneBytes;
  return small;
}

class Lane {
 public:
  Lane() : rig_(limits()), connection_(rig_), rule_(kLaneBytes, {}) {
    connection_.peer.set_room(1);
    rig_.push(connection_.outbox, "begun", {.lane = kLane});
    FUZZ_MUST(connection_.flush() == Flush::blocked);
  }

  void burst(fuzz::Choices& choices) {
    static constexpr std::uint8_t kPolicies[] = {0, 0, 0, 0, kDrop, kBlock};
    TestFrame frame{.kind = proto::Kind::group, .lane = kLane, .src = 1 + choices.below(20)};
    frame.flags = kPolicies[choices.below(6)];
    if (frame.flags == kBlock && ++block_bursts_ > kBlockBurstsMax) frame.flags = 0;
    const std::uint32_t size = kFrameBytesMin + choices.byte();
    const std::uint32_t spread = 1 + choices.byte();
    // No burst joins the one before it.
    frame.dst = 100 + made_;
    LaneRule::Entry entry{
        NodeId{7u << 20 | frame.src}, 0, frame.flags == kBlock, frame.flags == kDrop, {}};
    std::vector<std::string> payloads(1 + choices.below(12));
    for (std::string& payload : payloads) {
      payload = std::to_string(++made_);
      payload.resize(size - proto::kHeaderSize + (spread == 1 ? 0 : choices.below(spread)), '.');
      entry.size += static_cast<std::uint32_t>(proto::kHeaderSize + payload.size());
    }
    entry.payloads = payloads;
    rule_.come(std::move(entry));
    const hub::Run run = rig_.run(payloads, frame);
    connection_.outbox.push(run, run.header(), {choices.below(2) == 0}, rig_.context);
    FUZZ_MUST(rig_.dropped(proto::DropReason::queue_full) == rule_.dropped);
    FUZZ_MUST(connection_.outbox.has_untold_losses() == (rule_.dropped != 0));
  }

  void end() {
    connection_.peer.set_room(MemoryPeer::kAll);
    while (connection_.flush() != Flush::emptied) continue;
    std::vector<std::string> came = connection_.take();
    came.erase(came.begin());
    FUZZ_MUST(came == rule_.left());
    FUZZ_MUST(rig_.ledger_exact());
  }

 private:
  EgressRig rig_;
  TestConnection connection_;
  LaneRule rule_;
  std::uint32_t made_ = 0;
  int block_bursts_ = 0;
};

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  fuzz::Choices choices(fuzz::input(data, size));
  Lane lane;
  for (int bursts = 0; choices.left() && bursts < kBurstsMax; ++bursts) lane.burst(choices);
  lane.end();
  return 0;
}
