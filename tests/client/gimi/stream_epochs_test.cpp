// Streams whose sender was started again under its id, and messages without a GIMI header.

#include <gtest/gtest.h>

#include <array>
#include <optional>
#include <string>
#include <string_view>
#include <thread>

#include "proto/control/ns.hpp"
#include "proto/control/ns_register.hpp"
#include "tests/client/gimi/support/conversation.hpp"

namespace gimnet::gimi {
namespace {

using test::Conversation;
using test::kKey;
using test::kOwnId;
using test::kPeerId;
using test::MessageOperation;
using test::Taken;

constexpr std::uint32_t kGroup = (7u << 20) | 11;

class StreamEpochsTest : public Conversation {
 protected:
  static std::span<const std::byte> bytes(std::string_view text) {
    return std::as_bytes(std::span(text));
  }
  void send_data(std::uint32_t epoch, std::uint32_t sequence, std::string_view text,
                 std::uint8_t flags = 0) {
    answer({sequence, MessageOperation::data, flags, 0, epoch}, bytes(text));
  }
  /// To the service, as its provider.
  void publish(std::uint32_t epoch, std::uint32_t sequence, std::string_view text) {
    std::array<std::byte, proto::gimi::kMessagePrefixMax> prefix;
    const std::size_t size = proto::gimi::write_message_prefix(
        {sequence, MessageOperation::data, 0, 0, epoch}, std::nullopt, prefix);
    proto::FrameParts parts;
    parts.header.kind = proto::Kind::group;
    parts.header.dst = kGroup;
    parts.header.src = kPeerId;
    parts.key = 0;
    hub_.send(parts, std::string(reinterpret_cast<const char*>(prefix.data()), size) += text);
  }
  [[nodiscard]] Subscription subscribe() {
    std::optional<Subscription> made;
    std::thread asking([&] { made.emplace(node_->subscribe("peer/map").or_throw()); });
    std::uint16_t number = 0;
    EXPECT_TRUE(hub_.next_request<proto::ns::Subscribe>(number));
    proto::ns::SubscribeAnswer answer;
    answer.group = GroupId{kGroup};
    answer.provider = NodeId{kPeerId};
    hub_.send_control(proto::Kind::ns, proto::encode_answer(answer, number));
    asking.join();
    return *made;
  }
  void send_plain(proto::Kind kind, std::uint32_t dst, const std::string& text) {
    proto::FrameParts parts;
    parts.header.kind = kind;
    parts.header.dst = dst;
    parts.header.src = kPeerId;
    hub_.send(parts, text);
  }
};

TEST_F(StreamEpochsTest, AProviderThatIsStartedAgainLosesNothing) {
  const Subscription map = subscribe();
  for (std::uint32_t epoch = 1; epoch <= 5; ++epoch) publish(epoch, 1, "map");
  for (std::uint32_t epoch = 1; epoch <= 5; ++epoch) {
    const auto message = map.receive();
    ASSERT_TRUE(message);
    EXPECT_EQ(message->sequence(), 1u);
    EXPECT_EQ(message->begins_stream(), epoch != 1) << epoch;
  }
  EXPECT_EQ(map.missed(), 0u);
}

TEST_F(StreamEpochsTest, TheSameRetainedMessageComesOnce) {
  const Subscription map = subscribe();
  publish(7, 1, "map");
  publish(7, 1, "map");
  publish(7, 3, "newer");
  EXPECT_EQ(map.receive()->text(), "map");
  EXPECT_EQ(map.receive()->text(), "newer");
  EXPECT_EQ(map.missed(), 1u);
}

TEST_F(StreamEpochsTest, WhatAReplacedStreamHadUnderWayIsDroppedAndCounted) {
  const Subscription map = subscribe();
  publish(1, 5, "old");
  publish(2, 1, "new");
  publish(1, 6, "late");
  publish(2, 2, "newer");
  for (const char* text : {"old", "new", "newer"}) EXPECT_EQ(map.receive()->text(), text);
  EXPECT_EQ(map.missed(), 0u);
  send_data(1, 5, "old");
  send_data(2, 1, "new");
  send_data(1, 6, "late");
  send_data(2, 2, "newer");
  for (const char* text : {"old", "new", "newer"}) EXPECT_EQ(node_->receive(kKey)->text(), text);
  EXPECT_EQ(node_->lost().outdated, 2u);
}

TEST_F(StreamEpochsTest, AnAckSpeaksOfOneEpoch) {
  const std::uint8_t wanted = proto::gimi::kFlagAckWanted;
  send_data(1, 40, "old", wanted);
  Taken ack = next();
  EXPECT_EQ(ack.header.epoch, 1u);
  EXPECT_EQ(ack.header.sequence, 40u);
  send_data(2, 3, "new", wanted);
  ack = next();
  EXPECT_EQ(ack.header.epoch, 2u);
  EXPECT_EQ(ack.header.sequence, 3u);
  const std::array<std::byte, proto::gimi::kPingTimeSize> sent{};
  answer({9, MessageOperation::ping, wanted, 0, 5}, sent);
  ack = next();
  EXPECT_EQ(ack.header, (proto::gimi::MessageHeader{0, MessageOperation::ack, 0, 0, 5}))
      << "nothing came of that epoch";
  EXPECT_EQ(next().header, (proto::gimi::MessageHeader{9, MessageOperation::pong, 0, 0, 5}));
}

TEST_F(StreamEpochsTest, AnswersToAnotherEpochChangeNothing) {
  const Sender stream = sender(4);
  stream.send("x").or_throw();
  const std::uint32_t epoch = next().header.epoch;
  std::array<std::byte, proto::gimi::kAckSizeMax> data;
  const std::size_t size = proto::gimi::encode_ack({0, 0, 0}, data);
  answer({1, MessageOperation::ack, 0, 0, epoch + 1}, std::span(data).first(size));
  answer({1, MessageOperation::error, 0, 0, epoch + 1}, proto::gimi::encode_error({6, "large", 0}));
  send_data(1, 1, "behind them");
  ASSERT_TRUE(node_->receive(kKey));
  EXPECT_EQ(stream.counts().acknowledged, 0u);
  EXPECT_EQ(stream.counts().lost, 0u);
  answer({1, MessageOperation::ack, 0, 0, epoch}, std::span(data).first(size));
  EXPECT_TRUE(stream.settle());
}

TEST_F(StreamEpochsTest, SendersOfOneStreamShareItsEpoch) {
  sender(0).send("a").or_throw();
  sender(0).send("b").or_throw();
  const Taken first = next();
  const Taken second = next();
  EXPECT_EQ(first.header.epoch, second.header.epoch);
  EXPECT_EQ(second.header.sequence, 2u);
  SendOptions options;
  options.key = {9, 9};
  node_->send(Peer{kPeerId}, "c", options).or_throw();
  EXPECT_NE(next().header.epoch, first.header.epoch);
}

class KeptEpochs : public Conversation {
 protected:
  KeptEpochs() : Conversation(true) {}
  /// The node wants to be told the group of its service.
  void answer_advertise() {
    std::uint16_t number = 0;
    EXPECT_TRUE(hub_.next_request<proto::ns::Advertise>(number));
    proto::ns::AdvertiseAnswer advertised;
    advertised.group = GroupId{kGroup};
    advertised.subscribers = 1;
    hub_.send_control(proto::Kind::ns, proto::encode_answer(advertised, number));
  }
  void come_back(const proto::Welcome& welcome) {
    hub_.close();
    hub_ = fake_.admit(welcome);
    answer_advertise();
  }
};

TEST_F(KeptEpochs, OutliveBreaksRestartsOfTheHubOtherIdsAndNames) {
  const Sender stream = sender(0);
  std::optional<Publisher> map;
  std::thread advertising([&] { map.emplace(node_->advertise("map").or_throw()); });
  answer_advertise();
  advertising.join();
  std::uint32_t sequence = 0;
  std::array<std::uint32_t, 2> epochs{};
  const auto expect_epochs = [&](const char* after) {
    SCOPED_TRACE(after);
    ++sequence;
    stream.send("x").or_throw();
    const Taken sent = next_data();
    map->publish("x", kForever).or_throw();
    const Taken published = next_data();
    if (sequence == 1) epochs = {sent.header.epoch, published.header.epoch};
    EXPECT_EQ(sent.header.epoch, epochs[0]);
    EXPECT_EQ(published.header.epoch, epochs[1]);
    EXPECT_EQ(sent.header.sequence, sequence);
    EXPECT_EQ(published.header.sequence, sequence);
  };
  expect_epochs("the beginning");
  EXPECT_NE(epochs[0], epochs[1]);
  proto::Welcome welcome = nif::test::make_welcome();
  come_back(welcome);
  expect_epochs("a break");
  ++welcome.epoch;
  come_back(welcome);
  expect_epochs("a restart of the hub");
  welcome.node = NodeId{kOwnId + 1};
  come_back(welcome);
  expect_epochs("another id");
  std::thread renaming([&] { node_->take_name("forklift").or_throw(); });
  std::uint16_t number = 0;
  EXPECT_TRUE(hub_.next_request<proto::ns::RegisterName>(number));
  hub_.send_control(proto::Kind::ns,
                    proto::encode_answer(proto::ns::RegisterNameAnswer{"forklift", {}}, number));
  answer_advertise();
  renaming.join();
  expect_epochs("another name");
}

TEST_F(StreamEpochsTest, APlainMessageIsGivenOutAsSuch) {
  send_plain(proto::Kind::unicast, kOwnId, "to one");
  const Subscription map = subscribe();
  send_plain(proto::Kind::group, kGroup, "to all");
  const auto one = node_->receive(MessageKey{0, 0});
  ASSERT_TRUE(one);
  EXPECT_TRUE(one->plain());
  EXPECT_EQ(one->text(), "to one");
  EXPECT_EQ(one->sequence(), 0u);
  const auto all = map.receive();
  ASSERT_TRUE(all);
  EXPECT_TRUE(all->plain());
  EXPECT_EQ(all->text(), "to all");
  EXPECT_EQ(all->service(), "peer/map");
  EXPECT_EQ(node_->lost().all(), 0u);
}

TEST_F(StreamEpochsTest, AKeyWithoutAGimiHeaderIsCounted) {
  proto::FrameParts parts;
  parts.header.dst = kOwnId;
  parts.header.src = kPeerId;
  parts.key = 3;
  hub_.send(parts, std::string(proto::gimi::kMessageHeaderSize - 1, 'x'));
  send_data(1, 1, "behind it");
  const auto message = node_->receive();
  ASSERT_TRUE(message);
  EXPECT_FALSE(message->plain());
  EXPECT_EQ(node_->lost().unreadable, 1u);
}

}  // namespace
}  // namespace gimnet::gimi
