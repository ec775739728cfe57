#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cstring>

#include "proto/frame/frame_parser.hpp"
#include "proto/frame/report.hpp"
#include "tests/hub/shard/support/hub_rig.hpp"

// A linked hub that sends frames that no library could read.

namespace gimnet::hub {
namespace {

using proto::Kind;
using testing::FakeNode;
using testing::FrameSpec;
using testing::GotFrame;
using testing::HubRig;
using ::testing::IsEmpty;

constexpr HubId kNear{20};
constexpr std::uint32_t kSource = make_id<NodeId>(kNear, 3).value();

/// A frame of a node of the linked hub.
void write(HubRig& rig, FakeNode& link, std::uint32_t dst, const std::string& payload,
           FrameSpec spec) {
  spec.src = kSource;
  rig.write(link, HubRig::frame(link, dst, payload, spec));
}

/// A library reads the frame, and goes on.
void expect_readable(const GotFrame& frame) {
  std::vector<std::byte> bytes(proto::kHeaderSize);
  proto::store_header(bytes.data(), frame.header);
  bytes.insert(bytes.end(), frame.body.begin(), frame.body.end());
  const auto view = proto::parse_frame(bytes, proto::Origin::hub);
  ASSERT_TRUE(view) << proto::frame_error_text(view.error());
  if (frame.header.kind == Kind::report) {
    EXPECT_TRUE(proto::decode_report(view->payload));
  }
  if (frame.header.kind == Kind::flow) {
    EXPECT_TRUE(proto::flow::decode(view->payload));
    EXPECT_EQ(frame.header.dst, 0u);
  }
}

TEST(HostileLink, NoFrameOfItReachesANodeThatItCannotRead) {
  for (const std::size_t shard : {0u, 1u}) {
    HubRig rig(2);
    FakeNode& node = rig.join(0);
    FakeNode& link = rig.link(shard, kNear);
    rig.publish_group(5, node.id, {&node}, true);
    for (unsigned kind = 0; kind < 32; ++kind) {
      if (kind == static_cast<unsigned>(Kind::link)) continue;  // it may be a GOODBYE
      for (unsigned flags = 0; flags < 256; ++flags) {
        const auto size = (kind * 7 + flags * 11) % 41;
        std::string payload(size, '\0');
        for (std::size_t i = 0; i < size; ++i) payload[i] = static_cast<char>(i * flags + kind);
        // PAUSE about a node behind the link, which may be passed on.
        if (kind == static_cast<unsigned>(Kind::flow) && size >= 8) {
          payload[0] = static_cast<char>(proto::flow::FlowOperation::pause);
          payload[1] = payload[2] = payload[3] = 0;
          std::memcpy(payload.data() + 4, &kSource, sizeof kSource);
        }
        const auto lane = static_cast<std::uint8_t>(flags % 5 == 4 ? flags : flags % 4);
        for (const std::uint32_t dst : {node.id.value(), HubRig::group(5)}) {
          write(rig, link, dst, payload,
                {.kind = static_cast<Kind>(kind),
                 .flags = static_cast<std::uint8_t>(flags),
                 .lane = lane});
        }
      }
      rig.settle();
    }
    EXPECT_FALSE(link.goodbye);
    ASSERT_FALSE(node.goodbye);
    EXPECT_GT(node.frames.size(), 100u);
    EXPECT_FALSE(node.flow_of<proto::flow::Pause>().empty());
    EXPECT_GT(std::ranges::count(node.kinds, Kind::report), 5);
    for (const auto* got : {&node.frames, &node.control})
      for (const GotFrame& frame : *got) expect_readable(frame);
    EXPECT_TRUE(rig.ledger().exact());
  }
}

TEST(HostileLink, AReportThatNoLibraryCanReadIsDroppedAndToldOf) {
  HubRig rig;
  FakeNode& node = rig.join(0);
  FakeNode& link = rig.link(0, kNear);
  const std::string whole(proto::kReportSizeMin, '\1');
  const auto told = [&](const std::string& payload, FrameSpec spec) {
    spec.kind = Kind::report;
    rig.pass_ms(1'000);
    write(rig, link, node.id.value(), payload, spec);
    rig.settle();
    return std::ranges::any_of(rig.take_events(), [&link](const ShardEvent& event) {
      const auto* frame = std::get_if<ControlFrameEvent>(&event.what);
      return frame != nullptr && frame->node == link.id &&
             frame->frame.size() == proto::kHeaderSize;
    });
  };
  EXPECT_TRUE(told(whole.substr(1), {}));
  EXPECT_TRUE(told(whole, {.lane = 4}));
  for (const std::uint8_t flag : {proto::kFlagFragment, proto::kFlagExt, proto::kFlagKeyed})
    EXPECT_TRUE(told(whole, {.flags = flag}));
  EXPECT_THAT(node.reports(), IsEmpty());
  EXPECT_EQ(rig.sum(&ShardCounters::malformed), 5u);
  EXPECT_FALSE(told(whole, {}));
  EXPECT_EQ(std::ranges::count(node.kinds, Kind::report), 1);
  EXPECT_EQ(rig.sum(&ShardCounters::malformed), 5u);
  EXPECT_FALSE(link.goodbye);
}

}  // namespace
}  // namespace gimnet::hub
