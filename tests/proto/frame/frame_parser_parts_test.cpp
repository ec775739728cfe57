#include <gtest/gtest.h>

#include <cstddef>
#include <cstdint>
#include <vector>

#include "proto/frame/frame_builder.hpp"
#include "proto/frame/frame_parser.hpp"
#include "tests/vectors/vector_file.hpp"

namespace gimnet::proto {
namespace {

using test::Bytes;
using test::load_vector;

FrameError error_of(const Bytes& frame, Origin origin = Origin::node) {
  const auto parsed = parse_frame(frame, origin);
  return parsed ? FrameError::none : parsed.error();
}

// parse_frame()

TEST(ParseFrame, TakesTheExampleApart) {
  const auto bytes = load_vector("frame/unicast");
  const auto frame = parse_frame(bytes, Origin::node);
  ASSERT_TRUE(frame);
  EXPECT_EQ(frame->header.length, 2u);
  EXPECT_EQ(frame->header.dst, 0x00700012u);
  EXPECT_EQ(frame->header.src, 0x00700011u);
  EXPECT_EQ(frame->header.kind, Kind::unicast);
  EXPECT_EQ(frame->header.lane, 1);
  EXPECT_EQ(test::to_bytes(frame->payload), test::to_bytes("hi"));
  EXPECT_FALSE(frame->fragment || frame->key);
}

TEST(ParseFrame, TakesEveryPartInItsOrder) {
  const auto bytes = load_vector("frame/list_everything");
  const auto frame = parse_frame(bytes, Origin::node);
  ASSERT_TRUE(frame);
  ASSERT_EQ(frame->recipients.size(), 1u);
  EXPECT_EQ(frame->recipients[0], NodeId{0x00700012});
  EXPECT_EQ(frame->extensions.size(), 3u);
  EXPECT_EQ(frame->fragment, (FragmentHeader{9, 0, 2}));
  EXPECT_EQ(frame->key, 0x0000000100000003u);
  EXPECT_EQ(test::to_bytes(frame->payload), test::to_bytes("hi"));
  EXPECT_EQ(frame->after_header.size(), frame->header.length);
}

TEST(ParseFrame, TakesTheRecipientsFrameOfAListFromAHub) {
  const auto bytes = load_vector("frame/list_to_recipient");
  const auto frame = parse_frame(bytes, Origin::hub);
  ASSERT_TRUE(frame);
  EXPECT_TRUE(frame->recipients.empty());
  EXPECT_EQ(test::to_bytes(frame->payload), test::to_bytes("hi"));
  EXPECT_EQ(error_of(bytes, Origin::node), FrameError::list_count);
}

TEST(ParseFrame, LetsAHubSendWhatANodeMayNot) {
  const auto report = load_vector("frame/report");
  EXPECT_EQ(error_of(report, Origin::hub), FrameError::none);
  EXPECT_EQ(error_of(report, Origin::node), FrameError::kind_not_allowed);
  auto hops = load_vector("frame/unicast");
  hops[14] = std::byte{63};
  hops[13] = std::byte{0xC0};
  EXPECT_EQ(error_of(hops, Origin::hub), FrameError::none);
}

TEST(ParseFrame, TakesEveryVectorAndRefusesEachThatIsCut) {
  for (const std::string folder : {"frame", "flow", "gimi", "ns", "ctrl", "route"}) {
    for (const auto& name : test::vectors_in(folder)) {
      const auto bytes = load_vector(name);
      EXPECT_EQ(error_of(bytes, Origin::hub), FrameError::none) << name;
      for (std::size_t size = 0; size < bytes.size(); ++size) {
        const Bytes cut(bytes.begin(), bytes.begin() + static_cast<std::ptrdiff_t>(size));
        EXPECT_EQ(error_of(cut, Origin::hub), FrameError::incomplete) << name << " at " << size;
      }
    }
  }
}

/// The frame with its length, and so its payload, cut to `length`.
Bytes shortened(Bytes frame, std::uint32_t length) {
  store_le(frame.data(), length);
  frame.resize(kHeaderSize + length);
  return frame;
}

TEST(ParseFrame, NamesWhatDoesNotFit) {
  // ids 4, EXT 2 + 3, fragment header 12, key 8, payload 2
  const auto frame = load_vector("frame/list_everything");
  EXPECT_EQ(error_of(shortened(frame, 3)), FrameError::list_too_short);
  EXPECT_EQ(error_of(shortened(frame, 5)), FrameError::ext_too_short);
  EXPECT_EQ(error_of(shortened(frame, 8)), FrameError::ext_too_short);
  EXPECT_EQ(error_of(shortened(frame, 20)), FrameError::fragment_too_short);
  EXPECT_EQ(error_of(shortened(frame, 28)), FrameError::key_too_short);
  EXPECT_EQ(error_of(shortened(frame, 29)), FrameError::fragment_empty);
  EXPECT_EQ(error_of(shortened(frame, 31)), FrameError::none);
}

TEST(ParseFrame, RefusesAnExtensionThatDoesNotFit) {
  auto frame = load_vector("frame/list_everything");
  frame[kHeaderSize + 4 + 2 + 1] = std::byte{2};  // the PAD's length: one more than EXT has
  EXPECT_EQ(error_of(frame), FrameError::ext_too_short);
}

TEST(ParseFrame, ChecksFragmentsAgainstTheirTotal) {
  auto frame = load_vector("frame/fragment_last");  // message 9, offset 3, total 6, payload 3
  EXPECT_EQ(error_of(frame), FrameError::none);
  store_fragment_header(frame.data() + kHeaderSize, {9, 4, 6});
  EXPECT_EQ(error_of(frame), FrameError::fragment_over_total);
  store_fragment_header(frame.data() + kHeaderSize, {9, UINT32_MAX - 2, UINT32_MAX});
  EXPECT_EQ(error_of(frame), FrameError::fragment_over_total) << "offset + payload does not wrap";
  store_fragment_header(frame.data() + kHeaderSize, {9, UINT32_MAX - 3, UINT32_MAX});
  EXPECT_EQ(error_of(frame), FrameError::none);
}

TEST(ParseFrame, RefusesAListThatIsNotStrictlyAscending) {
  auto frame = load_vector("frame/list_from_node");
  EXPECT_EQ(error_of(frame), FrameError::none);
  store_le(frame.data() + kHeaderSize + 4, std::uint32_t{0x00700012});
  EXPECT_EQ(error_of(frame), FrameError::list_not_ascending) << "repeated";
  store_le(frame.data() + kHeaderSize + 4, std::uint32_t{0x00700011});
  EXPECT_EQ(error_of(frame), FrameError::list_not_ascending) << "descending";
}

TEST(ParseFrame, TakesAListOf1024) {
  std::vector<NodeId> ids;
  for (std::uint32_t i = 1; i <= kListRecipientsMax; ++i) ids.push_back(NodeId{i});
  FrameParts parts;
  parts.header.kind = Kind::list;
  parts.header.src = 0x00700011;
  parts.recipients = ids;
  Bytes frame(prefix_size(parts));
  ASSERT_EQ(write_frame(parts, {}, frame), frame.size());
  const auto parsed = parse_frame(frame, Origin::node);
  ASSERT_TRUE(parsed);
  EXPECT_EQ(parsed->recipients.size(), kListRecipientsMax);
  EXPECT_EQ(parsed->recipients[1023], NodeId{1024});
}

TEST(FrameErrorText, SaysEachCause) {
  for (std::size_t i = 0; i < kFrameErrorCount; ++i) {
    EXPECT_STRNE(frame_error_text(static_cast<FrameError>(i)), "unknown error");
  }
  EXPECT_STREQ(frame_error_text(FrameError::fragment_over_total),
               "a fragment ends after the message's total");
  EXPECT_STREQ(frame_error_text(static_cast<FrameError>(kFrameErrorCount)), "unknown error");
}

}  // namespace
}  // namespace gimnet::proto
