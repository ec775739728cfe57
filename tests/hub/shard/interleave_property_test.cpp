// Large messages of several senders to one slow receiver, in one lane, from a seed: each stream
// arrives whole and in order, and what is sent while a message is under way goes before the rest of
// it.

#include <gtest/gtest.h>

#include <cstring>
#include <deque>
#include <map>
#include <random>
#include <set>

#include "proto/frame/fragment_header.hpp"
#include "tests/hub/shard/support/hub_rig.hpp"

namespace gimnet::hub {
namespace {

using proto::Kind;
using testing::FakeNode;
using testing::GotFrame;
using testing::HubRig;

constexpr std::uint8_t kLane = 1;
constexpr int kFrames = 600;

/// One frame of a message, with the number under which it was sent.
std::string payload_of(std::uint64_t ticket, std::size_t size) {
  std::string payload(std::max(size, sizeof ticket), '.');
  std::memcpy(payload.data(), &ticket, sizeof ticket);
  return payload;
}

std::string fragment_of(const proto::FragmentHeader& header, const std::string& payload) {
  std::string body(proto::kFragmentHeaderSize, '\0');
  proto::store_fragment_header(reinterpret_cast<std::byte*>(body.data()), header);
  return body + payload;
}

/// Messages from one node in one kind: one after the other, some in fragments.
struct Stream {
  FakeNode* from = nullptr;
  Kind kind = Kind::unicast;
  std::uint32_t message = 0;  ///< its number; unique for its sender
  std::uint32_t offset = 0;
  std::uint32_t total = 0;                   ///< 0: no message is under way
  std::deque<std::uint64_t> under_way = {};  ///< tickets of frames that have not arrived
};

using MessageId = std::pair<std::uint32_t, std::uint32_t>;  // sender, number

class World {
 public:
  World(std::uint32_t seed, bool small_queues)
      : random_(seed), rig_(2, limits(small_queues)), roomy_(!small_queues) {
    receiver_ = &rig_.join(0);
    receiver_->pipe.set_room(2'000);
    const std::size_t senders = 2 + below(4);
    for (std::size_t i = 0; i < senders; ++i) {
      FakeNode& node = rig_.join(i % 2);
      streams_.push_back({.from = &node, .message = 1'000});
      if (below(2) == 0) streams_.push_back({.from = &node, .kind = Kind{9}, .message = 2'000'000});
    }
  }

  void run() {
    for (int i = 0; i < kFrames && !::testing::Test::HasFailure(); ++i) {
      send_next(streams_[below(streams_.size())]);
      if (below(3) == 0) read(below(12'000));
    }
    for (int i = 0; i < 10'000 && rig_.ledger().queued != 0; ++i) read(4'000);
    rig_.settle();
    take_frames();
    EXPECT_EQ(rig_.ledger().dropped, 0u);
    for (const Stream& stream : streams_)
      EXPECT_TRUE(stream.under_way.empty()) << stream.under_way.size();
    if (roomy_) {
      EXPECT_GT(arrived_before_, 0) << "nothing small ever waited behind something large";
    }
  }

 private:
  static Limits limits(bool small_queues) {
    Limits limits;
    // With room for all, what was written is in its lane in the order of the tickets.
    limits.lane1_bytes = small_queues ? 16 * 1024 : 64 << 20;
    limits.reserve_bytes = small_queues ? 16 * 1024 : 1 << 20;
    return limits;
  }
  std::size_t below(std::size_t bound) { return random_() % bound; }

  void send_next(Stream& stream) {
    const std::uint64_t ticket = ++ticket_;
    stream.under_way.push_back(ticket);
    if (stream.total == 0 && below(3) != 0) {
      stream.total = static_cast<std::uint32_t>(1 + below(60'000));
      stream.offset = 0;
      ++stream.message;
    }
    if (stream.total == 0) {
      if (roomy_) waiting_[ticket] = begun_;
      send(stream, payload_of(ticket, below(100)), 0);
    } else {
      send_fragment(stream, ticket);
    }
    // To the other shard and into the lane.
    rig_.turn();
    rig_.turn();
  }

  void send_fragment(Stream& stream, std::uint64_t ticket) {
    std::uint32_t size = static_cast<std::uint32_t>(8 + below(8'000));
    if (stream.total - stream.offset < size + 8) size = std::max(stream.total - stream.offset, 8u);
    stream.total = std::max(stream.total, stream.offset + size);
    send(stream,
         fragment_of({stream.message, stream.offset, stream.total}, payload_of(ticket, size)),
         proto::kFlagFragment);
    stream.offset += size;
    if (stream.offset == stream.total) stream.total = 0;
  }

  void send(Stream& stream, const std::string& body, std::uint8_t flags) {
    rig_.send(*stream.from, receiver_->id.value(), body,
              {.kind = stream.kind, .flags = flags, .lane = kLane});
  }

  void read(std::size_t bytes) {
    receiver_->read(bytes);
    rig_.turn();
    take_frames();
  }

  void take_frames() {
    for (const GotFrame& frame : receiver_->frames) check(frame);
    receiver_->frames.clear();
  }

  void check(const GotFrame& frame) {
    const bool fragment = frame.header.has(proto::kFlagFragment);
    std::uint64_t ticket = 0;
    std::memcpy(&ticket, frame.body.data() + (fragment ? proto::kFragmentHeaderSize : 0),
                sizeof ticket);
    Stream& stream = stream_of(frame);
    ASSERT_FALSE(stream.under_way.empty());
    EXPECT_EQ(stream.under_way.front(), ticket) << "out of order, twice, or with a gap";
    stream.under_way.pop_front();
    waiting_.erase(ticket);
    if (!fragment) return;
    const MessageId message{frame.header.src,
                            proto::load_fragment_header(frame.body.data()).message};
    begun_.insert(message);
    for (const auto& [waiting, begun_before] : waiting_) {
      if (waiting > ticket || !begun_before.contains(message)) continue;
      ++passed_wrongly_;
      EXPECT_EQ(passed_wrongly_, 0)
          << "frame " << ticket << " of a message under way went before frame " << waiting;
    }
    arrived_before_ += waiting_.empty() ? 0 : 1;
  }

  Stream& stream_of(const GotFrame& frame) {
    for (Stream& stream : streams_) {
      if (stream.from->id.value() == frame.header.src && stream.kind == frame.header.kind)
        return stream;
    }
    ADD_FAILURE() << "from nobody";
    return streams_.front();
  }

  std::mt19937 random_;
  HubRig rig_;
  const bool roomy_;
  FakeNode* receiver_ = nullptr;
  std::vector<Stream> streams_;
  std::uint64_t ticket_ = 0;
  std::set<MessageId> begun_;  ///< of which a fragment arrived
  std::map<std::uint64_t, std::set<MessageId>>
      waiting_;  ///< small frames, and what was begun when they were sent
  int arrived_before_ = 0;
  int passed_wrongly_ = 0;
};

class Interleaving : public ::testing::TestWithParam<std::uint32_t> {};

INSTANTIATE_TEST_SUITE_P(Seeds, Interleaving, ::testing::Range(0u, 20u));

TEST_P(Interleaving, WhatWaitsGoesBeforeTheRestOfMessagesUnderWay) {
  World world(GetParam(), false);
  world.run();
}

TEST_P(Interleaving, ArrivesWholeAndInOrderThroughFullQueues) {
  World world(GetParam(), true);
  world.run();
}

// The sender of a large message that does not heed PAUSE is not read meanwhile.
TEST(LargeMessage, ASmallFrameWaitsForNoMoreThanTheQueueHolds) {
  for (const std::size_t shard : {0u, 1u}) {
    SCOPED_TRACE(shard);
    const Limits limits;
    HubRig rig(2, limits);
    FakeNode& reader = rig.join(0);
    FakeNode& large = rig.join(shard);
    FakeNode& small = rig.join(0);
    constexpr std::size_t kRoom = 16 * 1024;
    constexpr std::uint32_t kTotal = 30'000'000;
    constexpr std::uint32_t kPiece = 60'000;
    reader.pipe.set_room(kRoom);
    for (std::uint32_t offset = 0; offset < kTotal; offset += kPiece) {
      rig.send(large, reader.id.value(), fragment_of({1, offset, kTotal}, std::string(kPiece, 'x')),
               {.flags = proto::kFlagFragment});
    }
    for (int i = 0; i < 20; ++i) {
      rig.turn();
      reader.read();
    }
    rig.send(small, reader.id.value(), "small");
    std::uint64_t before = 0;
    bool came = false;
    while (!came && before < kTotal) {
      rig.turn();
      reader.read();
      for (const GotFrame& frame : reader.frames) {
        came = came || frame.header.src == small.id.value();
        if (!came) before += frame.body.size();
      }
      reader.frames.clear();
    }
    EXPECT_LE(before, limits.lane1_bytes + limits.reserve_bytes + 2 * limits.turn_bytes + kRoom +
                          limits.mailbox_bytes * shard);
    EXPECT_TRUE(came);
    EXPECT_EQ(rig.ledger().dropped, 0u);
  }
}

}  // namespace
}  // namespace gimnet::hub
