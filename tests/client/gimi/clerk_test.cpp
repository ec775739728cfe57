#include "client/gimi/clerk.hpp"

#include <gtest/gtest.h>

#include <array>
#include <cstddef>

#include "tests/client/gimi/support/conversation.hpp"

namespace gimnet::gimi {
namespace {

using test::Conversation;
using test::kOwnId;
using test::kPeerId;
using test::Operation;
using test::Taken;

class ClerkTest : public Conversation {
 protected:
  static constexpr std::uint32_t kSlow = kPeerId + 1;

  void pause(std::uint32_t node) {
    for (std::uint8_t lane = 0; lane < proto::kLaneCount; ++lane) {
      hub_.send(proto::flow::Pause{{proto::Kind::unicast, static_cast<proto::Lane>(lane), node}});
    }
  }

  void resume(std::uint32_t node) {
    for (std::uint8_t lane = 0; lane < proto::kLaneCount; ++lane) {
      hub_.send(proto::flow::Resume{{proto::Kind::unicast, static_cast<proto::Lane>(lane), node}});
    }
  }

  /// A DATA that asks for an ACK.
  void send_data(std::uint32_t from) {
    std::array<std::byte, proto::gimi::kMessagePrefixMax> prefix;
    const proto::gimi::MessageHeader header{1, Operation::data, proto::gimi::kFlagAckWanted, 0};
    const std::size_t size = proto::gimi::write_message_prefix(header, std::nullopt, prefix);
    proto::FrameParts parts;
    parts.header.kind = proto::Kind::unicast;
    parts.header.dst = kOwnId;
    parts.header.src = from;
    parts.key = proto::gimi::StreamKey{test::kKey.type, test::kKey.instance}.value();
    hub_.send(parts, {reinterpret_cast<const char*>(prefix.data()), size});
  }
};

TEST_F(ClerkTest, LooksAfterStreamsWhileAnAckWaitsForItsWay) {
  const Sender stream = sender(3);
  pause(kSlow);
  send_data(kSlow);
  send_data(kPeerId);
  const Taken ack = next();
  ASSERT_EQ(ack.header.operation, Operation::ack);
  ASSERT_EQ(ack.frame.dst, kPeerId) << "the ACK for the other one was tried before";
  stream.send("is not acknowledged").or_throw();
  EXPECT_EQ(next().header.operation, Operation::data);
  EXPECT_EQ(next().header.operation, Operation::ping) << "asks for the ACK";
}

TEST_F(ClerkTest, AnAckThatWaitsForItsWayIsOne) {
  pause(kSlow);
  for (int i = 0; i < 5; ++i) {
    send_data(kSlow);
    send_data(kPeerId);
    ASSERT_EQ(next().frame.dst, kPeerId) << "the ACK for the other one was tried before";
  }
  resume(kSlow);
  EXPECT_EQ(next().frame.dst, kSlow);
  send_data(kPeerId);
  EXPECT_EQ(next().frame.dst, kPeerId);
}

}  // namespace
}  // namespace gimnet::gimi
