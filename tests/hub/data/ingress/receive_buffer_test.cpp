#include "hub/data/ingress/receive_buffer.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cstring>
#include <random>

#include "proto/frame/frame_parser.hpp"
#include "tests/hub/data/support/egress_rig.hpp"

namespace gimnet::hub {
namespace {

using testing::EgressRig;

class ReceiveBufferTest : public ::testing::Test {
 protected:
  /// One connection that reads a stream in given pieces, as the reader does it.
  struct Reading {
    FrameTail tail;
    std::vector<std::string> got;
    std::vector<BufferRef> kept;  ///< references to every tenth frame
  };
  /// Reads up to `bytes` of `from`; returns how many.
  std::size_t read(Reading& reading, std::span<const std::byte> from, std::size_t bytes) {
    const std::span<std::byte> room = buffer.prepare(reading.tail);
    const std::size_t size = std::min({bytes, from.size(), room.size()});
    std::memcpy(room.data(), from.data(), size);
    const ReceiveBuffer::Received received = buffer.commit(reading.tail, size);
    const std::byte* next = received.begin;
    while (true) {
      const proto::NextRun found = proto::next_run(next, received.end, 65'536);
      if (found.found != proto::Found::run) {
        EXPECT_TRUE(buffer.keep(reading.tail, next, received.end, found.needed));
        return size;
      }
      for (std::uint32_t done = 0; done < found.run.size;) {
        const proto::FrameHeader header = proto::load_header(found.run.bytes + done);
        reading.got.emplace_back(
            reinterpret_cast<const char*>(found.run.bytes + done + proto::kHeaderSize),
            header.length);
        done += static_cast<std::uint32_t>(header.frame_size());
        if (reading.got.size() % 10 == 0) reading.kept.push_back(buffer.buffer().share());
      }
      next += found.run.size;
    }
  }

  EgressRig rig;
  ReceiveBuffer buffer{rig.pool, rig.tally, 64 << 20};
};

TEST_F(ReceiveBufferTest, GivesTheSameFramesForAnySplit) {
  for (std::uint32_t seed = 0; seed < 20; ++seed) {
    std::mt19937 random(seed);
    // Of so many some have a slab to themselves, some a chunk.
    constexpr std::size_t kConnections = 24;
    std::array<Reading, kConnections> readings;
    std::array<std::vector<std::byte>, kConnections> streams;
    std::array<std::vector<std::string>, kConnections> sent;
    std::array<std::size_t, kConnections> done{};
    for (std::size_t connection = 0; connection < kConnections; ++connection) {
      for (int i = 0; i < 10; ++i) {
        const std::size_t size = random() % 3 == 0 ? random() % 65'537 : random() % 2'000;
        sent[connection].emplace_back(size, static_cast<char>('a' + i % 26));
        const auto frame = EgressRig::bytes(sent[connection].back());
        streams[connection].insert(streams[connection].end(), frame.begin(), frame.end());
      }
    }
    for (std::size_t finished = 0; finished < kConnections;) {
      const std::size_t connection = random() % kConnections;
      const std::size_t piece = random() % 2 == 0 ? 1 + random() % 300'000 : 1 + random() % 3'000;
      if (done[connection] == streams[connection].size()) continue;
      done[connection] += read(readings[connection],
                               std::span(streams[connection]).subspan(done[connection]), piece);
      if (done[connection] == streams[connection].size()) ++finished;
      if (random() % 4 == 0) readings[connection].kept.clear();
    }
    for (std::size_t connection = 0; connection < kConnections; ++connection) {
      EXPECT_EQ(readings[connection].got, sent[connection]);
      EXPECT_TRUE(readings[connection].tail.empty());
    }
  }
}

TEST_F(ReceiveBufferTest, OfALargeFrameNoPayloadByteIsMoved) {
  const auto frame = EgressRig::bytes(std::string(60'000, 'x'));
  Reading header;
  read(header, frame, 16);
  EXPECT_FALSE(header.tail.own);
  EXPECT_EQ(header.tail.size, 16u);
  EXPECT_EQ(header.tail.needed, 60'016u);
  EXPECT_EQ(rig.tally.moved_tail_bytes, 16u);
  Reading more;
  read(more, frame, 17);
  EXPECT_TRUE(more.tail.own);
  read(more, std::span(frame).subspan(17), 20'000);
  read(more, std::span(frame).subspan(20'017), 100'000);
  EXPECT_EQ(more.got.size(), 1u);
  EXPECT_EQ(rig.tally.moved_tail_bytes, 16u);
}

TEST_F(ReceiveBufferTest, OfASmallFrameALittleIsCopiedAndMoreStays) {
  const auto frame = EgressRig::bytes(std::string(2'000, 'x'));
  Reading little;
  read(little, frame, 1'024);
  EXPECT_FALSE(little.tail.own);
  EXPECT_EQ(rig.tally.moved_tail_bytes, 1'024u);
  Reading more;
  read(more, frame, 1'025);
  EXPECT_TRUE(more.tail.own);
  EXPECT_EQ(rig.tally.moved_tail_bytes, 1'024u);
}

TEST_F(ReceiveBufferTest, BeyondAFewSlabsABegunFrameKeepsOnlyItsOwnSize) {
  const auto frame = EgressRig::bytes(std::string(60'000, 'x'));
  std::vector<Reading> readings(100);
  for (Reading& each : readings) read(each, frame, 30'000);
  EXPECT_EQ(buffer.own_slabs(), 16u);
  EXPECT_EQ(readings[15].tail.buffer->kind, BufferKind::slab);
  EXPECT_EQ(readings[16].tail.buffer->kind, BufferKind::chunk);
  EXPECT_LE(readings[16].tail.buffer->capacity, 65'536u + 16);
  // It grows where it is, and is moved once.
  const std::uint64_t moved = rig.tally.moved_tail_bytes;
  const Buffer* own = readings[99].tail.buffer.get();
  read(readings[99], std::span(frame).subspan(30'000), 10'000);
  EXPECT_EQ(readings[99].tail.buffer.get(), own);
  EXPECT_EQ(rig.tally.moved_tail_bytes, moved);
  read(readings[99], std::span(frame).subspan(40'000), 100'000);
  ASSERT_EQ(readings[99].got.size(), 1u);
  EXPECT_EQ(readings[99].got[0], std::string(60'000, 'x'));
  EXPECT_TRUE(readings[99].tail.empty());
  // A slab that is free again may be owned again.
  read(readings[0], std::span(frame).subspan(30'000), 100'000);
  EXPECT_EQ(buffer.own_slabs(), 15u);
  for (Reading& each : readings) buffer.forget(each.tail);
  EXPECT_EQ(buffer.own_slabs(), 0u);
}

TEST_F(ReceiveBufferTest, TheLargestFrameMayBeginAtTheLastByteThatIsReadInto) {
  for (const std::uint32_t before : {0u, 1u, 15u, 16u, 17u}) {
    Reading reading;
    // Frames up to a few bytes before the end of what one read takes, then a largest one.
    std::vector<std::byte> stream;
    while (stream.size() + 1'016 < kSlabReadBytes - before) {
      const auto frame = EgressRig::bytes(std::string(1'000, 'a'));
      stream.insert(stream.end(), frame.begin(), frame.end());
    }
    const std::size_t rest = kSlabReadBytes - before - stream.size();
    const auto filler = EgressRig::bytes(std::string(rest < 16 ? 0 : rest - 16, 'b'));
    stream.insert(stream.end(), filler.begin(), filler.end());
    const auto largest = EgressRig::bytes(std::string(65'536, 'c'));
    stream.insert(stream.end(), largest.begin(), largest.end());
    for (std::size_t done = 0; done < stream.size();)
      done += read(reading, std::span(stream).subspan(done), 1 << 20);
    EXPECT_EQ(reading.got.back(), std::string(65'536, 'c'));
  }
}

TEST_F(ReceiveBufferTest, RewindsWhileNobodyKeepsAReference) {
  Reading reading;
  const auto frame = EgressRig::bytes(std::string(1'000, 'x'));
  read(reading, frame, 10'000);
  const std::byte* first = buffer.buffer()->data;
  rig.pool.pin(*buffer.buffer().get(), rig.lease);
  for (int i = 0; i < 7; ++i) read(reading, frame, 10'000);
  EXPECT_EQ(buffer.buffer()->data, first);
  FrameTail tail;
  EXPECT_EQ(buffer.prepare(tail).size(), kSlabReadBytes) << "from the beginning";
  EXPECT_EQ(rig.pool.pinned_bytes(), 0u) << "and nobody keeps it";
  static_cast<void>(buffer.commit(tail, 0));
  reading.kept.push_back(buffer.buffer().share());
  read(reading, frame, 10'000);
  EXPECT_LT(buffer.prepare(tail).size(), kSlabReadBytes) << "behind what is kept";
}

TEST_F(ReceiveBufferTest, BoundsWhatAllTailsKeep) {
  ReceiveBuffer small(rig.pool, rig.tally, 3'000);
  FrameTail tails[4];
  const auto frame = EgressRig::bytes(std::string(2'000, 'x'));
  int kept = 0;
  for (FrameTail& tail : tails) {
    std::memcpy(small.prepare(tail).data(), frame.data(), 1'000);
    const auto received = small.commit(tail, 1'000);
    kept += small.keep(tail, received.begin, received.end, 2'016) ? 1 : 0;
  }
  EXPECT_EQ(kept, 3) << "exactly the limit, and not one more";
  small.forget(tails[0]);
  EXPECT_TRUE(tails[0].empty());
  std::memcpy(small.prepare(tails[3]).data(), frame.data(), 1'000);
  const auto received = small.commit(tails[3], 1'000);
  EXPECT_TRUE(small.keep(tails[3], received.begin, received.end, 2'016));
}

}  // namespace
}  // namespace gimnet::hub
