#include "proto/frame/frame_parser.hpp"

#include <gtest/gtest.h>

#include <cstddef>
#include <cstdint>
#include <random>
#include <vector>

#include "proto/frame/frame_builder.hpp"
#include "tests/vectors/vector_file.hpp"

namespace gimnet::proto {
namespace {

using test::Bytes;
using test::load_vector;

constexpr std::uint32_t kMax = kFrameLengthDefault;

FrameHeader header_to(std::uint32_t dst, Kind kind = Kind::unicast, std::uint8_t flags = 0) {
  FrameHeader header;
  header.dst = dst;
  header.src = 0x00700011;
  header.kind = kind;
  header.flags = flags;
  return header;
}

void append_frame(Bytes& bytes, FrameHeader header, std::size_t payload) {
  header.length = static_cast<std::uint32_t>(payload);
  const std::size_t at = bytes.size();
  bytes.resize(at + kHeaderSize + payload, std::byte{0x5A});
  store_header(bytes.data() + at, header);
}

NextRun run_of(const Bytes& bytes, std::uint32_t max = kMax) {
  return next_run(bytes.data(), bytes.data() + bytes.size(), max);
}

// next_run()

TEST(NextRun, AsksForAHeader) {
  const Bytes bytes(kHeaderSize - 1);
  for (std::size_t size = 0; size < kHeaderSize; ++size) {
    const auto next = next_run(bytes.data(), bytes.data() + size, kMax);
    EXPECT_EQ(next.found, Found::need_more);
    EXPECT_EQ(next.needed, kHeaderSize);
  }
}

TEST(NextRun, AsksForTheWholeFrame) {
  Bytes bytes;
  append_frame(bytes, header_to(1), 100);
  bytes.pop_back();
  const auto next = run_of(bytes);
  EXPECT_EQ(next.found, Found::need_more);
  EXPECT_EQ(next.needed, kHeaderSize + 100);
}

TEST(NextRun, JoinsFramesWithEqualHeadersAndAnyLength) {
  Bytes bytes;
  for (const std::size_t payload : {16u, 0u, 1u, 4096u}) append_frame(bytes, header_to(1), payload);
  const std::size_t whole = bytes.size();
  append_frame(bytes, header_to(2), 16);
  const auto next = run_of(bytes);
  ASSERT_EQ(next.found, Found::run);
  EXPECT_EQ(next.run.bytes, bytes.data());
  EXPECT_EQ(next.run.frames, 4u);
  EXPECT_EQ(next.run.size, whole);
}

TEST(NextRun, EndsBeforeAFrameThatIsNotWhole) {
  for (std::size_t missing = 1; missing <= kHeaderSize + 8; ++missing) {
    Bytes bytes;
    for (int i = 0; i < 3; ++i) append_frame(bytes, header_to(1), 8);
    bytes.resize(bytes.size() - missing);
    const auto next = run_of(bytes);
    ASSERT_EQ(next.found, Found::run);
    EXPECT_EQ(next.run.frames, 2u);
    EXPECT_EQ(next.run.size, 2 * (kHeaderSize + 8));
  }
}

TEST(NextRun, EndsWhereAnyOtherByteOfTheHeaderDiffers) {
  for (std::size_t byte = 4; byte < kHeaderSize; ++byte) {
    Bytes bytes;
    append_frame(bytes, header_to(1), 8);
    append_frame(bytes, header_to(1), 8);
    bytes[kHeaderSize + 8 + byte] ^= std::byte{0x40};
    const auto next = run_of(bytes);
    ASSERT_EQ(next.found, Found::run);
    EXPECT_EQ(next.run.frames, 1u) << "byte " << byte;
  }
}

TEST(NextRun, EndsAtTheFirstDifferentHeaderHoweverManyAreEqual) {
  constexpr std::size_t kFrames = 14;
  for (const std::size_t payload : {0u, 1u, 16u}) {
    const std::size_t frame_size = kHeaderSize + payload;
    Bytes equal;
    for (std::size_t i = 0; i < kFrames; ++i) append_frame(equal, header_to(1), payload);
    EXPECT_EQ(run_of(equal).run.frames, kFrames);
    for (std::size_t other = 1; other < kFrames; ++other) {
      for (std::size_t byte = 4; byte < kHeaderSize; ++byte) {
        Bytes bytes = equal;
        bytes[other * frame_size + byte] ^= std::byte{0x40};
        const auto next = run_of(bytes);
        ASSERT_EQ(next.run.frames, other) << "payload " << payload << ", byte " << byte;
        ASSERT_EQ(next.run.size, other * frame_size);
      }
    }
    for (std::size_t whole = 1; whole < kFrames; ++whole) {
      const auto next = next_run(equal.data(), equal.data() + (whole + 1) * frame_size - 1, kMax);
      ASSERT_EQ(next.run.frames, whole) << "the last byte of the next one is missing";
    }
  }
}

TEST(NextRun, GoesOnBehindEqualFramesWithOneOfAnotherLength) {
  for (std::size_t equal = 1; equal < 14; ++equal) {
    Bytes bytes;
    for (std::size_t i = 0; i < equal; ++i) append_frame(bytes, header_to(1), 16);
    append_frame(bytes, header_to(1), 3);
    for (std::size_t i = 0; i < equal; ++i) append_frame(bytes, header_to(1), 40);
    const auto next = run_of(bytes);
    EXPECT_EQ(next.run.frames, 2 * equal + 1);
    EXPECT_EQ(next.run.size, bytes.size());
    EXPECT_EQ(next.run.last_bytes, kHeaderSize + 40);
  }
}

TEST(NextRun, EndsAt64KiB) {
  constexpr std::size_t kPayload = 84;  // frames of 100 bytes
  Bytes bytes;
  while (bytes.size() < 3 * kRunBytesMax) append_frame(bytes, header_to(1), kPayload);
  const auto next = run_of(bytes);
  EXPECT_EQ(next.run.frames, kRunBytesMax / 100);
  EXPECT_EQ(next.run.last_bytes, 100u);
  for (const std::size_t more : {0u, 1u}) {
    Bytes exact;
    append_frame(exact, header_to(1), kPayload);
    append_frame(exact, header_to(1), kRunBytesMax - 100 - kHeaderSize + more);
    append_frame(exact, header_to(1), 0);
    EXPECT_EQ(run_of(exact, kFrameLengthMax).run.frames, more == 0 ? 2u : 1u);
  }
}

TEST(NextRun, OfALargerFrameIsThatFrame) {
  Bytes bytes;
  append_frame(bytes, header_to(1), kRunBytesMax);
  append_frame(bytes, header_to(1), 0);
  const auto next = run_of(bytes, kFrameLengthMax);
  EXPECT_EQ(next.run.frames, 1u);
  EXPECT_EQ(next.run.size, kHeaderSize + kRunBytesMax);
  EXPECT_EQ(next.run.last_bytes, next.run.size);
}

TEST(NextRun, GivesSomeFramesSingly) {
  const std::vector<FrameHeader> single = {
      header_to(2, Kind::list),          header_to(0, Kind::flow),
      header_to(0, Kind::link),          header_to(0, Kind::ns),
      header_to(0, Kind::ctrl),          header_to(0, static_cast<Kind>(200)),
      header_to(1, Kind::unicast, 0x08), header_to(1, Kind::unicast, 0x10),
      header_to(1, Kind::unicast, 0x23), header_to(1, Kind::group, 3),
      header_to(1, Kind::report)};
  for (const FrameHeader& header : single) {
    Bytes bytes;
    append_frame(bytes, header, 32);
    append_frame(bytes, header, 32);
    EXPECT_EQ(run_of(bytes).run.frames, 1u)
        << int{static_cast<std::uint8_t>(header.kind)} << " " << int{header.flags};
  }
}

TEST(NextRun, JoinsEveryOtherDataKind) {
  for (const int kind : {0, 1, 3, 4, 7, 8, 15}) {
    Bytes bytes;
    append_frame(bytes, header_to(1, static_cast<Kind>(kind), kFlagKeyed | kFlagReport), 32);
    append_frame(bytes, header_to(1, static_cast<Kind>(kind), kFlagKeyed | kFlagReport), 32);
    EXPECT_EQ(run_of(bytes).run.frames, 2u) << kind;
  }
}

TEST(NextRun, RefusesALengthOverTheLimit) {
  Bytes bytes;
  append_frame(bytes, header_to(1), 65);
  EXPECT_EQ(run_of(bytes, 65).found, Found::run);
  EXPECT_EQ(run_of(bytes, 64).found, Found::too_long);
  store_le(bytes.data(), UINT32_MAX);
  EXPECT_EQ(run_of(bytes, kFrameLengthMax).found, Found::too_long);
}

TEST(NextRun, EndsBeforeALengthOverTheLimit) {
  Bytes bytes;
  append_frame(bytes, header_to(1), 8);
  append_frame(bytes, header_to(1), 65);
  EXPECT_EQ(run_of(bytes, 64).run.frames, 1u);
}

/// Frames of a stream, each with its bytes, as a reader finds them that gets the stream in the
/// given pieces.
std::vector<Bytes> frames_of(const Bytes& stream, const std::vector<std::size_t>& cuts) {
  std::vector<Bytes> frames;
  Bytes buffer;
  std::size_t from = 0;
  for (const std::size_t cut : cuts) {
    buffer.insert(buffer.end(), stream.begin() + static_cast<std::ptrdiff_t>(from),
                  stream.begin() + static_cast<std::ptrdiff_t>(cut));
    from = cut;
    std::size_t at = 0;
    for (;;) {
      const auto next = next_run(buffer.data() + at, buffer.data() + buffer.size(), kMax);
      if (next.found != Found::run) break;
      for (std::size_t end = at + next.run.size; at < end;) {
        const std::size_t size = load_header(buffer.data() + at).frame_size();
        frames.push_back(test::to_bytes(std::span<const std::byte>(buffer).subspan(at, size)));
        at += size;
      }
    }
    buffer.erase(buffer.begin(), buffer.begin() + static_cast<std::ptrdiff_t>(at));
  }
  return frames;
}

TEST(NextRun, FindsTheSameFramesHoweverTheBytesAreSplit) {
  std::mt19937 random(7);  // NOLINT: the same every time
  Bytes stream;
  for (int i = 0; i < 40; ++i) append_frame(stream, header_to(1 + random() % 2), random() % 40);
  const auto whole = frames_of(stream, {stream.size()});
  ASSERT_EQ(whole.size(), 40u);
  for (int trial = 0; trial < 200; ++trial) {
    std::vector<std::size_t> cuts;
    for (std::size_t at = random() % 30; at < stream.size(); at += 1 + random() % 60)
      cuts.push_back(at);
    cuts.push_back(stream.size());
    EXPECT_EQ(frames_of(stream, cuts), whole);
  }
}

// check_header_from_node()

TEST(CheckHeader, AcceptsEveryLegalHeader) {
  EXPECT_EQ(check_header_from_node(header_to(1)), FrameError::none);
  EXPECT_EQ(check_header_from_node(header_to(1, Kind::unicast, 1)), FrameError::none);
  EXPECT_EQ(check_header_from_node(header_to(1, Kind::unicast, 3 | kFlagKeyed)), FrameError::none);
  EXPECT_EQ(check_header_from_node(header_to(1, Kind::group, 3)), FrameError::none);
  EXPECT_EQ(check_header_from_node(header_to(1, static_cast<Kind>(15))), FrameError::none);
  EXPECT_EQ(check_header_from_node(header_to(0, Kind::ctrl)), FrameError::none);
}

TEST(CheckHeader, NamesEachCause) {
  auto lane = header_to(1);
  lane.lane = 4;
  EXPECT_EQ(check_header_from_node(lane), FrameError::reserved_lane_bits);
  auto hops = header_to(1);
  hops.hops = 1;
  EXPECT_EQ(check_header_from_node(hops), FrameError::hops_not_zero);
  EXPECT_EQ(check_header_from_node(header_to(1, Kind::unicast, 0x40)),
            FrameError::reserved_flag_bits);
  EXPECT_EQ(check_header_from_node(header_to(1, Kind::unicast, 0x80)),
            FrameError::reserved_flag_bits);
  EXPECT_EQ(check_header_from_node(header_to(1, static_cast<Kind>(20))), FrameError::unknown_kind);
  EXPECT_EQ(check_header_from_node(header_to(1, static_cast<Kind>(255))), FrameError::unknown_kind);
  EXPECT_EQ(check_header_from_node(header_to(1, Kind::report)), FrameError::kind_not_allowed);
  EXPECT_EQ(check_header_from_node(header_to(1, Kind::route)), FrameError::kind_not_allowed);
  EXPECT_EQ(check_header_from_node(header_to(1, Kind::unicast, 3)), FrameError::latest_without_key);
  EXPECT_EQ(check_header_from_node(header_to(1, Kind::service, 3)), FrameError::latest_without_key);
  for (const Kind kind : {Kind::group, Kind::list, Kind::broadcast}) {
    EXPECT_EQ(check_header_from_node(header_to(1, kind, 1)), FrameError::block_not_allowed);
  }
}

// The bytes that these flags put before the payload would be read as the payload.
TEST(CheckHeader, KnowsWhichFlagsAKindMayCarry) {
  for (const Kind kind : {Kind::flow, Kind::link, Kind::ns, Kind::ctrl}) {
    const bool for_this_connection = kind == Kind::flow || kind == Kind::link;
    for (unsigned flags = 0; flags < 0x40; ++flags) {
      const unsigned forbidden = kFlagFragment | kFlagKeyed | (for_this_connection ? kFlagExt : 0u);
      EXPECT_EQ(check_header_from_node(header_to(0, kind, static_cast<std::uint8_t>(flags))),
                (flags & forbidden) != 0 ? FrameError::flag_not_allowed : FrameError::none)
          << static_cast<unsigned>(kind) << " with " << flags;
    }
  }
  for (const Kind kind : {Kind::unicast, Kind::group, Kind::list, Kind::broadcast, Kind::service,
                          Kind::taken, static_cast<Kind>(8), static_cast<Kind>(15)}) {
    EXPECT_EQ(check_header_from_node(header_to(1, kind, 0x3C)), FrameError::none)
        << static_cast<unsigned>(kind);
  }
}

TEST(CheckHeader, NothingStandsBeforeThePayloadOfAReportOrFlowOfAHub) {
  constexpr unsigned kForbidden = kFlagFragment | kFlagKeyed | kFlagExt;
  for (const Kind kind : {Kind::report, Kind::flow}) {
    for (unsigned flags = 0; flags < 0x100; ++flags) {
      FrameHeader header = header_to(1, kind, static_cast<std::uint8_t>(flags));
      header.hops = 5;
      EXPECT_EQ(check_header_of_hub_word(header),
                (flags & kForbidden) != 0 ? FrameError::flag_not_allowed : FrameError::none)
          << flags;
      header.lane = 4;
      EXPECT_EQ(check_header_of_hub_word(header), FrameError::reserved_lane_bits);
    }
  }
}

TEST(CheckHeader, BoundsTheRecipientsOfAList) {
  EXPECT_EQ(check_header_from_node(header_to(0, Kind::list)), FrameError::list_count);
  EXPECT_EQ(check_header_from_node(header_to(1, Kind::list)), FrameError::none);
  EXPECT_EQ(check_header_from_node(header_to(1024, Kind::list)), FrameError::none);
  EXPECT_EQ(check_header_from_node(header_to(1025, Kind::list)), FrameError::list_count);
}
}  // namespace
}  // namespace gimnet::proto
