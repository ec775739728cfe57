#include "generator/wire.hpp"

#include <gtest/gtest.h>
#include <sys/socket.h>

#include "generator/flood.hpp"

namespace gimnet::perf {
namespace {

/// Two clients whose sockets are never used.
class WireTest : public testing::Test {
 protected:
  MessageBlock block_of(std::size_t payload_bytes, std::size_t messages, Target target) {
    MessageBlock block;
    for (std::size_t count = 0; count < messages; ++count) {
      wire_.append_message(from_, target, 1, pattern_payload(payload_bytes), block);
    }
    block.renew();
    to_.inbox.expect(target.stream, payload_bytes);
    return block;
  }

  Wire wire_;
  Client from_{0, ::socket(AF_UNIX, SOCK_STREAM, 0)};
  Client to_{1, ::socket(AF_UNIX, SOCK_STREAM, 0)};
  const Target unicast_{.kind = Target::Kind::unicast, .recipients = {&to_}, .stream = 5};
};

TEST_F(WireTest, ReadsWhatItWritesHoweverItIsSplit) {
  for (const std::size_t size : {16u, 4096u, 4097u, 65536u}) {
    const MessageBlock block = block_of(size, 3, unicast_);
    for (std::size_t split = 0; split <= block.bytes.size(); split += 1 + block.bytes.size() / 97) {
      Client reader{1, ::socket(AF_UNIX, SOCK_STREAM, 0)};
      reader.inbox.expect(5, size);
      const std::span<const std::byte> bytes(block.bytes);
      const std::size_t done = wire_.take(reader, bytes.first(split));
      EXPECT_LE(done, split);
      EXPECT_EQ(done + wire_.take(reader, bytes.subspan(done)), bytes.size());
      EXPECT_EQ(reader.inbox.delivered(), 3u) << size << " bytes split at " << split;
      EXPECT_EQ(reader.inbox.wrong(), 0u);
    }
  }
}

TEST_F(WireTest, SendsSmallMessagesAsOneFrameAndLargeOnesInPieces) {
  EXPECT_EQ(block_of(16, 1, unicast_).bytes.size(), 32u);
  EXPECT_EQ(block_of(4096, 1, unicast_).bytes.size(), 4096u + 16u);
  EXPECT_EQ(block_of(65536, 1, unicast_).bytes.size(), 65536u + 2 * (16u + 12u));
}

TEST_F(WireTest, SeesAMessageForSomebodyElse) {
  const Target wrong{.kind = Target::Kind::unicast, .recipients = {&from_}, .stream = 5};
  const MessageBlock block = block_of(16, 1, wrong);
  EXPECT_EQ(wire_.take(to_, block.bytes), block.bytes.size());
  EXPECT_EQ(to_.inbox.delivered(), 0u);
  EXPECT_EQ(to_.inbox.wrong(), 1u);
}

TEST_F(WireTest, ListsItsRecipientsInOrder) {
  const Target list{.kind = Target::Kind::list, .recipients = {&to_, &from_}};
  const MessageBlock block = block_of(16, 1, list);
  const auto header = proto::load_header(block.bytes.data());
  EXPECT_EQ(header.kind, proto::Kind::list);
  EXPECT_EQ(header.dst, 2u);
  EXPECT_EQ(header.length, 8u + 16u);
  EXPECT_LT(load_le<std::uint32_t>(block.bytes.data() + 16),
            load_le<std::uint32_t>(block.bytes.data() + 20));
}

TEST_F(WireTest, PublishesWholeMessagesOnly) {
  int sockets[2];
  ASSERT_EQ(::socketpair(AF_UNIX, SOCK_STREAM | SOCK_NONBLOCK, 0, sockets), 0);
  Client sender(0, sockets[0]);
  const Client receiver(1, sockets[1]);
  Publisher publisher(wire_, sender, {unicast_}, {.payload_bytes = 1000}, Writing::batched);
  EXPECT_EQ(publisher.messages_a_write(), 65536u / 1016u);
  EXPECT_EQ(publisher.publish(publisher.messages_a_write() - 1), 0u)
      << "more than the window lets through";
  EXPECT_EQ(publisher.publish(publisher.messages_a_write()), publisher.messages_a_write());
  sender.paused.push_back({});
  EXPECT_EQ(publisher.publish(UINT64_MAX), 0u) << "paused";
}

}  // namespace
}  // namespace gimnet::perf
