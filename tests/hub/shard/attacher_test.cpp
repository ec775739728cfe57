#include "hub/shard/attacher.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cstdio>

#include "tests/hub/shard/support/hub_rig.hpp"
#include "tests/net/support/toy_stream.hpp"

namespace gimnet::hub {
namespace {

using proto::DropReason;
using proto::GoodbyeCode;
using ::testing::ElementsAre;
using testing::FakeNode;
using testing::HubRig;
using testing::JoinSpec;
using ::testing::SizeIs;

constexpr JoinSpec kResume{.resume = true};
constexpr std::uint8_t kDrop = static_cast<std::uint8_t>(proto::Policy::drop);

TEST(Attacher, WritesTheOpeningAndWelcome) {
  HubRig rig;
  FakeNode& a = rig.join(0);
  EXPECT_TRUE(a.opened);
  ASSERT_TRUE(a.welcome);
  EXPECT_EQ(a.welcome->node, a.id);
  EXPECT_EQ(a.welcome->hub, rig.hub());
  EXPECT_EQ(a.welcome->resume_buffer_bytes, 0u) << "no resume was asked for";
  EXPECT_FALSE(a.welcome->resumed);
  ASSERT_THAT(a.control, SizeIs(1));
  EXPECT_EQ(a.control[0].header.dst, a.id.value());
  EXPECT_EQ(a.control[0].header.src, 7u << 20);
  EXPECT_EQ(rig.sum(&ShardCounters::connections), 1u);
}

TEST(Attacher, ANewConnectionMayTakeLess) {
  HubRig rig;
  FakeNode& a = rig.join(0);
  FakeNode& b = rig.join(0);
  FakeNode& c = rig.join(0);
  const auto send_in_turns = [&](std::size_t second_size) {
    std::vector<std::byte> bytes;
    for (const std::size_t size : {std::size_t{10}, second_size}) {
      for (const FakeNode* to : {&b, &c}) {
        const auto frame = HubRig::frame(a, to->id.value(), std::string(size, 'x'));
        bytes.insert(bytes.end(), frame.begin(), frame.end());
      }
    }
    rig.write(a, bytes);
    rig.settle();
  };
  send_in_turns(200);
  EXPECT_THAT(b.frames, SizeIs(2));
  rig.rejoin(b, {.frame_bytes = 100});
  rig.settle();
  b.frames.clear();
  send_in_turns(200);
  EXPECT_THAT(b.frames, SizeIs(1));
  EXPECT_THAT(c.frames, SizeIs(4));
  EXPECT_EQ(rig.dropped(DropReason::too_large), 1u);
}

TEST(Attacher, OffersResumeWhereItIsAskedFor) {
  HubRig rig;
  FakeNode& a = rig.join(0, kResume);
  ASSERT_TRUE(a.welcome);
  EXPECT_NE(a.welcome->epoch, 0u);
  EXPECT_EQ(a.welcome->resume_buffer_bytes, 1u << 20);
}

TEST(Attacher, FencesTheOldConnectionOfTheSession) {
  HubRig rig;
  FakeNode& a = rig.join(0);
  MemoryPeer old = a.pipe;
  FakeNode& b = rig.join(0);
  rig.rejoin(a);
  EXPECT_TRUE(old.transport_gone());
  FakeNode reader;
  reader.opened = true;
  reader.pipe = old;
  reader.read();
  ASSERT_TRUE(reader.goodbye);
  EXPECT_EQ(reader.goodbye->code, GoodbyeCode::replaced);
  EXPECT_FALSE(rig.take_detached()) << "the conductor made it so: it is not told";
  rig.send(b, a.id.value(), "to the new one");
  rig.settle();
  EXPECT_THAT(a.texts(), ElementsAre("to the new one"));
  EXPECT_EQ(rig.sum(&ShardCounters::connections), 2u);
}

TEST(Attacher, IgnoresWhatAFencedConnectionStillSends) {
  HubRig rig;
  FakeNode& a = rig.join(0);
  FakeNode& b = rig.join(0);
  MemoryPeer old = a.pipe;
  rig.rejoin(a);
  old.write(HubRig::frame(a, b.id.value(), "too late"));
  rig.settle();
  EXPECT_TRUE(b.frames.empty());
}

std::vector<std::string> numbered(std::size_t count) {
  std::vector<std::string> texts;
  for (std::size_t i = 0; i < count; ++i)
    texts.push_back("frame " + std::to_string(i) + std::string(i * 7 % 40, '.'));
  return texts;
}

TEST(Attacher, GoesOnAfterACutAtEveryByte) {
  const std::vector<std::string> sent = numbered(6);
  std::size_t total = 0;
  for (const std::string& text : sent) total += proto::kHeaderSize + text.size();
  for (std::size_t cut = 0; cut <= total; ++cut) {
    HubRig rig;
    FakeNode& a = rig.join(0);
    FakeNode& b = rig.join(0, kResume);
    b.pipe.reset_after(cut);
    for (std::size_t i = 0; i < 3; ++i) rig.send(a, b.id.value(), sent[i]);
    rig.settle();
    for (std::size_t i = 3; i < 6; ++i) rig.send(a, b.id.value(), sent[i]);
    rig.settle();
    rig.rejoin(b, kResume);
    ASSERT_TRUE(b.welcome && b.welcome->resumed) << cut;
    rig.settle();
    EXPECT_EQ(b.texts(), sent) << "cut after " << cut;
    EXPECT_EQ(b.skipped, 0u);
    rig.send_flow(b, proto::flow::Confirm{b.data_frames});
    rig.settle();
    EXPECT_EQ(rig.ledger().delivered, 6u);
    EXPECT_EQ(rig.ledger().queued, 0u);
  }
}

TEST(Attacher, GoesOnAfterManyCuts) {
  HubRig rig;
  FakeNode& a = rig.join(0);
  FakeNode& b = rig.join(0, kResume);
  std::vector<std::string> sent;
  for (std::size_t round = 0; round < 200; ++round) {
    b.pipe.reset_after(round * 13 % 111);
    for (int i = 0; i < 3; ++i) {
      sent.push_back(std::to_string(round) + "." + std::to_string(i));
      rig.send(a, b.id.value(), sent.back());
    }
    rig.settle();
    rig.rejoin(b, kResume);
    ASSERT_TRUE(b.welcome && b.welcome->resumed);
  }
  rig.settle();
  EXPECT_EQ(b.texts(), sent);
}

// WELCOME tells how much the hub took of what the node sent, so that the node sends the rest.
TEST(Attacher, TellsWhatItTookFromANodeThatWasCut) {
  HubRig rig;
  FakeNode& a = rig.join(0, kResume);
  FakeNode& b = rig.join(0);
  rig.send(a, b.id.value(), "one");
  rig.send(a, b.id.value(), "two");
  const auto third = HubRig::frame(a, b.id.value(), "three");
  rig.write(a, std::span(third).first(10));
  rig.settle();
  a.pipe.reset();
  rig.settle();
  rig.rejoin(a, kResume);
  ASSERT_TRUE(a.welcome);
  EXPECT_TRUE(a.welcome->resumed);
  EXPECT_EQ(a.welcome->taken, 2u);
  rig.write(a, third);
  rig.settle();
  EXPECT_THAT(b.texts(), ElementsAre("one", "two", "three"));
}

TEST(Attacher, BeginsAnewForAnotherLifeOfTheNode) {
  HubRig rig;
  FakeNode& a = rig.join(0);
  FakeNode& b = rig.join(0, kResume);
  b.pipe.reset_after(30);
  rig.send(a, b.id.value(), "lost with the old life of b");
  rig.settle();
  rig.rejoin(b, {.resume = true, .epoch = 78});
  ASSERT_TRUE(b.welcome);
  EXPECT_FALSE(b.welcome->resumed);
  rig.settle();
  EXPECT_EQ(rig.dropped(DropReason::link_lost), 1u);
  EXPECT_EQ(rig.ledger().queued, 0u);
}

TEST(Attacher, BeginsAnewForACountThatCannotBe) {
  HubRig rig;
  FakeNode& a = rig.join(0);
  FakeNode& b = rig.join(0, kResume);
  rig.send(a, b.id.value(), "one");
  rig.settle();
  b.data_frames = 5;
  rig.rejoin(b, kResume);
  ASSERT_TRUE(b.welcome);
  EXPECT_FALSE(b.welcome->resumed);
  EXPECT_EQ(rig.ledger().queued, 0u);
}

/// `count` frames that may be let go, 1 KiB each.
std::uint64_t flood(HubRig& rig, FakeNode& from, const FakeNode& to, std::uint64_t first,
                    std::uint64_t count) {
  for (std::uint64_t i = first; i < first + count; ++i) {
    std::string text = std::to_string(i);
    text.resize(1024 - proto::kHeaderSize, ' ');
    rig.send(from, to.id.value(), text, {.flags = kDrop});
  }
  return first + count;
}

/// Frames came in order and once, and those that did not come were announced.
void expect_gaps_announced(const FakeNode& node, std::uint64_t sent) {
  std::int64_t last = -1;
  for (const auto& frame : node.frames) {
    const std::int64_t number = std::stoll(frame.text());
    EXPECT_GT(number, last);
    last = number;
  }
  EXPECT_EQ(node.frames.size() + node.skipped, sent);
}

TEST(Attacher, AnnouncesWithSkipWhatASmallBufferLetGo) {
  Limits limits;
  limits.resume_bytes = 64 * 1024;
  HubRig rig(1, limits);
  FakeNode& a = rig.join(0);
  FakeNode& b = rig.join(0, kResume);
  const std::uint64_t sent = flood(rig, a, b, 0, 200);
  rig.settle_without_reading();  // all of it stands unread before b when the connection breaks
  b.pipe.reset();
  rig.settle_without_reading();
  rig.rejoin(b, kResume);
  rig.settle();
  ASSERT_TRUE(b.welcome && b.welcome->resumed);
  expect_gaps_announced(b, sent);
  EXPECT_EQ(b.skipped, 200u - 64u);
  EXPECT_EQ(rig.sum(&ShardCounters::gap_frames), b.skipped);
  EXPECT_EQ(rig.dropped(DropReason::link_lost), b.skipped);
}

// SKIP can be lost with the connection that carried it: it is said again.
TEST(Attacher, AnnouncesTheGapAgainWhenTheNextConnectionIsCutToo) {
  Limits limits;
  limits.resume_bytes = 64 * 1024;
  for (const bool skip_arrives : {false, true}) {
    HubRig rig(1, limits);
    FakeNode& a = rig.join(0);
    FakeNode& b = rig.join(0, kResume);
    std::uint64_t sent = flood(rig, a, b, 0, 100);
    rig.settle_without_reading();
    b.pipe.reset();
    rig.settle_without_reading();
    rig.rejoin(b, kResume);
    if (skip_arrives) {
      b.read();
      EXPECT_NE(b.skipped, 0u);
    } else {
      EXPECT_TRUE(b.welcome);
    }
    b.pipe.reset();
    rig.settle_without_reading();
    sent = flood(rig, a, b, sent, 10);
    rig.settle_without_reading();
    rig.rejoin(b, kResume);
    rig.settle();
    ASSERT_TRUE(b.welcome && b.welcome->resumed);
    expect_gaps_announced(b, sent);
    EXPECT_EQ(rig.dropped(DropReason::link_lost), b.skipped);
    rig.send_flow(b, proto::flow::Confirm{b.data_frames});
    rig.settle();
    EXPECT_EQ(rig.ledger().queued, 0u);
    EXPECT_EQ(rig.ledger().delivered, b.frames.size());
  }
}

TEST(Attacher, MessagesWaitForASessionThatIsAway) {
  HubRig rig;
  FakeNode& a = rig.join(0);
  FakeNode& waits = rig.join(0, kResume);
  FakeNode& gone = rig.join(0);
  waits.pipe.reset();
  gone.pipe.close();
  rig.settle();
  rig.send(a, waits.id.value(), "kept");
  rig.send(a, gone.id.value(), "dropped");
  rig.settle();
  EXPECT_EQ(rig.dropped(DropReason::away), 1u);
  EXPECT_EQ(rig.ledger().queued, 1u);
  rig.rejoin(waits, kResume);
  rig.rejoin(gone);
  rig.settle();
  EXPECT_THAT(waits.texts(), ElementsAre("kept"));
  EXPECT_TRUE(gone.frames.empty());
}

TEST(Attacher, ABrokenTransportIsToldToTheConductor) {
  HubRig rig;
  auto [transport, peer] = make_memory_pipe();
  peer.reset();
  AttachCommand command;
  command.session = {ConnectionSlot{3}, 9};
  command.attachment = 1;
  command.node = make_id<NodeId>(rig.hub(), 3);
  command.transport = std::move(transport);
  rig.command(0, std::move(command));
  rig.turn();
  const auto detached = rig.take_detached();
  ASSERT_TRUE(detached);
  EXPECT_EQ(detached->session.generation, 9u);
  EXPECT_EQ(rig.sum(&ShardCounters::connections), 0u);
}

/// A pipe whose descriptor no poller takes: epoll refuses regular files.
class UnpollableStream final : public net::Stream {
 public:
  explicit UnpollableStream(std::unique_ptr<net::Stream> pipe)
      : pipe_(std::move(pipe)), file_(std::tmpfile()) {}
  ~UnpollableStream() override { std::fclose(file_); }
  UnpollableStream(const UnpollableStream&) = delete;
  UnpollableStream& operator=(const UnpollableStream&) = delete;
  net::IoResult receive(std::span<std::byte> into) override { return pipe_->receive(into); }
  net::IoResult send(std::span<const iovec> pieces) override { return pipe_->send(pieces); }
  void shut_down() override {}
  [[nodiscard]] std::uint64_t unsent_bytes() const override { return 0; }
  void limit_unsent(std::uint32_t) override {}
  void limit_unacknowledged(std::uint32_t) override {}
  [[nodiscard]] int descriptor() const override { return ::fileno(file_); }

 private:
  std::unique_ptr<net::Stream> pipe_;
  std::FILE* file_;
};

TEST(Attacher, WhoCannotBePolledHearsWhyBehindTheOpening) {
  HubRig rig;
  auto [transport, peer] = make_memory_pipe();
  AttachCommand command;
  command.session = {ConnectionSlot{3}, 9};
  command.attachment = 1;
  command.node = make_id<NodeId>(rig.hub(), 3);
  command.transport = std::make_unique<UnpollableStream>(std::move(transport));
  rig.command(0, std::move(command));
  rig.turn();
  FakeNode node;
  node.pipe = std::move(peer);
  node.read();
  EXPECT_TRUE(node.opened);
  ASSERT_TRUE(node.goodbye);
  EXPECT_EQ(node.goodbye->code, proto::GoodbyeCode::no_memory);
  EXPECT_EQ(rig.sum(&ShardCounters::no_memory), 1u);
  EXPECT_EQ(rig.sum(&ShardCounters::connections), 0u);
}

// A stream that encrypts may have read on behind HELLO, and no poller shows that.
TEST(Attacher, ReadsTheBytesThatTheStreamKept) {
  HubRig rig;
  FakeNode& b = rig.join(0);
  auto [pipe, peer] = make_memory_pipe();
  auto stream = std::make_unique<net::ToyStream>(std::move(pipe));
  FakeNode a;
  a.id = make_id<NodeId>(rig.hub(), 3);
  std::vector<std::byte> bytes = rig.frame(a, b.id.value(), "kept", {});
  bytes.insert(bytes.begin(), std::byte{1});
  peer.write(net::ToyCode::encode(bytes));
  std::array<std::byte, 1> hello;
  ASSERT_EQ(stream->receive(hello).bytes, 1u);
  EXPECT_EQ(stream->pending_in(), bytes.size() - 1);
  AttachCommand command;
  command.session = {ConnectionSlot{3}, 9};
  command.attachment = 1;
  command.node = a.id;
  command.transport = std::move(stream);
  rig.command(0, std::move(command));
  rig.settle();
  EXPECT_THAT(b.texts(), ::testing::ElementsAre("kept"));
}

}  // namespace
}  // namespace gimnet::hub
