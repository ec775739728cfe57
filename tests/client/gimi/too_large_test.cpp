// Messages that are larger than their receivers take: each sender or subscriber is told.

#include <gtest/gtest.h>

#include <array>
#include <cstdint>
#include <optional>
#include <string>
#include <string_view>
#include <thread>

#include "gimnet/gimi.hpp"
#include "proto/control/control_message.hpp"
#include "proto/gimi/request.hpp"
#include "tests/client/gimi/support/conversation.hpp"
#include "tests/client/gimi/support/hub_process.hpp"

namespace gimnet {
namespace {

using gimi::test::kKey;
using gimi::test::kOwnId;
using gimi::test::kPeerId;
using gimi::test::MessageOperation;
using test::eventually;
using test::HubProcess;

constexpr Timeout kWait = std::chrono::duration_cast<Timeout>(test::kPatience);

/// Tests the answer of a node to the first fragment of a message of 65 MiB.
class BegunMessage : public gimi::test::Conversation {
 protected:
  static constexpr std::uint32_t kGroup = (7u << 20) | 11;
  static constexpr std::uint32_t kEpoch = 9;
  static constexpr std::uint32_t kSequence = 5;

  void begin(MessageOperation operation, proto::Kind kind = proto::Kind::service) {
    std::array<std::byte, proto::gimi::kMessagePrefixMax> prefix;
    const std::size_t size = proto::gimi::write_message_prefix({kSequence, operation, 0, 0, kEpoch},
                                                               std::nullopt, prefix);
    std::string payload(reinterpret_cast<const char*>(prefix.data()), size);
    proto::FrameParts parts;
    parts.header.kind = kind;
    parts.header.dst = kGroup;
    parts.header.src = kPeerId;
    parts.key = proto::gimi::StreamKey{kKey.type, kKey.instance}.value();
    parts.fragment = proto::FragmentHeader{++number_, 0, 65u << 20};
    hub_.send(parts, payload.append(1000, 'x'));
  }
  /// The first message of the node, which answers a PING behind all.
  gimi::test::Taken first_word() {
    answer({1, MessageOperation::ping, 0, 0, kEpoch}, {});
    return next();
  }
  static std::span<const std::byte> bytes(const std::string& text) {
    return std::as_bytes(std::span(text));
  }

  std::uint32_t number_ = 0;
};

TEST_F(BegunMessage, OfAServiceIsRefusedByAnErrorWithTheWordsOfItsReceiver) {
  begin(MessageOperation::data);
  const auto error = first_word();
  EXPECT_EQ(error.header.operation, MessageOperation::error);
  EXPECT_EQ(error.header.sequence, kSequence);
  EXPECT_EQ(error.header.epoch, kEpoch);
  EXPECT_EQ(error.frame.dst, kPeerId);
  const auto data = proto::gimi::decode_error(bytes(error.data));
  ASSERT_TRUE(data);
  EXPECT_EQ(data->status, static_cast<std::uint16_t>(proto::Status::limit)) << "as 0.9.0 reads it";
  EXPECT_EQ(data->group, kGroup);
  EXPECT_EQ(data->sentence, "it takes messages of at most 67108864 bytes, and this one is larger");
  EXPECT_EQ(node_->lost().too_large, 1u);
}

TEST_F(BegunMessage, OfARequestIsRefusedByItsFault) {
  begin(MessageOperation::request);
  const auto error = first_word();
  EXPECT_EQ(error.header.operation, MessageOperation::error);
  EXPECT_EQ(error.header.sequence, kSequence);
  EXPECT_EQ(error.header.epoch, kEpoch);
  const auto fault = proto::gimi::decode_request_error(bytes(error.data));
  ASSERT_TRUE(fault);
  EXPECT_EQ(fault->fault, proto::gimi::RequestFault::too_large);
}

TEST_F(BegunMessage, OfNoKnownSortIsNotAnswered) {
  begin(static_cast<MessageOperation>(200));
  begin(MessageOperation::pong);
  EXPECT_EQ(first_word().header.operation, MessageOperation::pong);
  EXPECT_EQ(node_->lost().too_large, 2u);
}

/// Two nodes, of which one takes messages of at most 1 MiB.
class SmallReceiver : public testing::Test {
 protected:
  static constexpr std::size_t kTakes = std::size_t{1} << 20;
  static NodeOptions small(const std::string& name, const std::string& url) {
    NodeOptions options;
    options.name = name;
    options.hub = url;
    options.message_bytes_max = kTakes;
    return options;
  }

  HubProcess hub_;
  const Node robot_ = Node::join(small("robot", hub_.url())).or_throw();
  const Node pilot_{"pilot", hub_.url()};
  /// More than the way holds, so that its sender waits for the receiver.
  const std::string large_ = std::string(std::size_t{48} << 20, 'x');
};

TEST_F(SmallReceiver, OfAServiceIsNamedByTheFailureOfSend) {
  const Accepted drive = robot_.accept("drive").or_throw();
  const auto sent = pilot_.send("robot/drive", large_, {}, kForever);
  ASSERT_TRUE(sent.is(Status::too_large));
  EXPECT_EQ(sent.failure().sentence,
            "cannot send to robot/drive: the receiver refused it: it takes messages of at most "
            "1048576 bytes, and this one is larger");
  pilot_.send("robot/drive", "small", {}, kForever).or_throw();
  EXPECT_EQ(drive.receive(kWait)->text(), "small") << "the stream goes on";
  EXPECT_EQ(robot_.lost().too_large, 1u);
}

TEST_F(SmallReceiver, EndsARequestThatIsTooLargeWhichWasNotDone) {
  const Answers sum = robot_.answer("sum").or_throw();
  const Reply reply = pilot_.request("robot/sum", large_, kWait);
  EXPECT_TRUE(reply.is(Status::too_large));
  EXPECT_EQ(reply.ran(), Ran::no);
  EXPECT_EQ(reply.failure().sentence,
            "robot/sum: the request is too large: it takes messages of at most 1048576 bytes");
}

TEST_F(SmallReceiver, EndsARequestWhoseReplyIsTooLarge) {
  const Answers pictures = pilot_.answer("picture").or_throw();
  std::thread answering([&] {
    auto request = pictures.receive(kWait).or_throw();
    EXPECT_TRUE(request.reply(large_).is(Status::too_large));
  });
  const Reply reply = robot_.request("pilot/picture", "", kWait);
  answering.join();
  EXPECT_TRUE(reply.is(Status::too_large));
  EXPECT_EQ(reply.ran(), Ran::maybe);
}

TEST_F(SmallReceiver, CountsWhatASubscriptionMissesAtOnce) {
  const Publisher eye = pilot_.advertise("eye").or_throw();
  const Subscription seen = robot_.subscribe("pilot/eye").or_throw();
  eye.wait_for_subscribers(1, kWait).or_throw();
  eye.publish("1", kForever).or_throw();
  eye.publish(std::string(kTakes + 1, 'x'), kForever).or_throw();
  EXPECT_TRUE(eventually([&] { return seen.missed() == 1; })) << "it came whole";
  eye.publish(std::string(4 * kTakes, 'x'), kForever).or_throw();
  EXPECT_TRUE(eventually([&] { return seen.missed() == 2; })) << "its first fragment came";
  eye.publish("4", kForever).or_throw();
  EXPECT_EQ(seen.receive(kWait)->text(), "1");
  EXPECT_EQ(seen.receive(kWait)->text(), "4");
  EXPECT_EQ(seen.missed(), 2u) << "they count once";
}

}  // namespace
}  // namespace gimnet
