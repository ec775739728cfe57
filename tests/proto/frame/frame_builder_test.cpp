#include "proto/frame/frame_builder.hpp"

#include <gtest/gtest.h>

#include <vector>

#include "proto/frame/frame_parser.hpp"
#include "tests/vectors/vector_file.hpp"

namespace gimnet::proto {
namespace {

using test::Bytes;
using test::load_vector;
using test::to_bytes;

/// Takes a frame apart and puts it together again.
Bytes rebuilt(const Bytes& bytes, Origin origin) {
  const auto frame = parse_frame(bytes, origin);
  if (!frame) return {};
  std::vector<NodeId> ids;
  for (std::uint32_t i = 0; i < frame->recipients.size(); ++i) ids.push_back(frame->recipients[i]);
  FrameParts parts;
  parts.header = frame->header;
  parts.recipients = ids;
  parts.extensions = frame->extensions;
  parts.fragment = frame->fragment;
  parts.key = frame->key;
  Bytes memory(bytes.size());
  memory.resize(write_frame(parts, frame->payload, memory));
  return memory;
}

TEST(FrameBuilder, WritesEveryVector) {
  for (const std::string folder : {"frame", "flow", "gimi", "ns", "ctrl", "route"}) {
    for (const auto& name : test::vectors_in(folder)) {
      const auto bytes = load_vector(name);
      EXPECT_EQ(rebuilt(bytes, Origin::hub), bytes) << name;
    }
  }
}

TEST(FrameBuilder, SetsFlagsLengthAndCountFromTheParts) {
  const std::vector<NodeId> ids{NodeId{0x00700012}};
  const Bytes pad{std::byte{0}, std::byte{1}, std::byte{0}};
  FrameParts parts;
  parts.header.src = 0x00700011;
  parts.header.kind = Kind::list;
  parts.recipients = ids;
  parts.extensions = pad;
  parts.fragment = FragmentHeader{9, 0, 2};
  parts.key = 0x0000000100000003;
  const auto expected = load_vector("frame/list_everything");
  Bytes memory(expected.size());
  ASSERT_EQ(write_frame(parts, to_bytes("hi"), memory), expected.size());
  EXPECT_EQ(memory, expected);
}

TEST(FrameBuilder, WritesAPrefixForAPayloadElsewhere) {
  const auto expected = load_vector("frame/unicast");
  FrameParts parts;
  parts.header.dst = 0x00700012;
  parts.header.src = 0x00700011;
  parts.payload_size = 2;
  Bytes memory(kPrefixSizeMax);
  ASSERT_EQ(write_prefix(parts, memory), kHeaderSize);
  memory.resize(kHeaderSize);
  EXPECT_EQ(memory, Bytes(expected.begin(), expected.begin() + kHeaderSize));
}

TEST(FrameBuilder, WritesNothingWithoutRoom) {
  FrameParts parts;
  parts.fragment = FragmentHeader{1, 0, 2};
  parts.key = 7;
  EXPECT_EQ(prefix_size(parts), kPrefixSizeMax);
  Bytes memory(kPrefixSizeMax + 1, std::byte{0xEE});
  EXPECT_EQ(write_prefix(parts, std::span(memory).first(kPrefixSizeMax - 1)), 0u);
  EXPECT_EQ(write_frame(parts, to_bytes("hi"), memory), 0u);
  EXPECT_EQ(memory, Bytes(kPrefixSizeMax + 1, std::byte{0xEE}));
  EXPECT_EQ(write_frame(parts, to_bytes("h"), memory), memory.size());
}

}  // namespace
}  // namespace gimnet::proto
