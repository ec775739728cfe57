#include "client/gimi/core.hpp"

#include <gtest/gtest.h>

#include <array>
#include <cstddef>
#include <functional>
#include <optional>
#include <string>
#include <thread>
#include <utility>
#include <vector>

#include "proto/control/ns.hpp"
#include "proto/frame/taken.hpp"
#include "tests/client/gimi/support/conversation.hpp"

// Tests the fate of callers that wait when no connection will come any more.

namespace gimnet::gimi {
namespace {

using proto::GoodbyeCode;
using test::Conversation;
using test::kKey;
using test::kPeerId;
using test::MessageOperation;

/// Dials again after breaks, as programs do.
class Dismissed : public Conversation, public testing::WithParamInterface<GoodbyeCode> {
 protected:
  Dismissed() : Conversation(true) {}
};

class WithoutReconnecting : public Conversation {};

class Reconnected : public Conversation {
 protected:
  Reconnected() : Conversation(true) {}
};

class Resumed : public Conversation {
 protected:
  Resumed() : Conversation(true, true) {}
};

class Lost : public Conversation {
 protected:
  static constexpr std::uint32_t kGroup = (7u << 20) | 11;

  void send_to_group(std::uint32_t group) {
    std::array<std::byte, proto::gimi::kMessagePrefixMax> prefix;
    const std::size_t size =
        proto::gimi::write_message_prefix({1, MessageOperation::data, 0, 0}, std::nullopt, prefix);
    proto::FrameParts parts;
    parts.header.kind = proto::Kind::group;
    parts.header.dst = group;
    parts.header.src = kPeerId;
    parts.key = 0;
    hub_.send(parts, {reinterpret_cast<const char*>(prefix.data()), size});
  }
  /// Everything that was sent before is taken too.
  void take_one() {
    const std::string text = "x";
    answer({1, MessageOperation::data, 0, 0}, std::as_bytes(std::span(text)));
    ASSERT_TRUE(node_->receive());
  }
  /// The first piece of a large message to this node.
  void begin_message(std::uint32_t number, std::uint32_t total) {
    proto::FrameParts parts;
    parts.header.dst = nif::test::kOwnId;
    parts.header.src = kPeerId;
    parts.key = 0;
    parts.fragment = proto::FragmentHeader{number, 0, total};
    hub_.send(parts, std::string(100, 'x'));
  }
};

TEST_P(Dismissed, EverybodyWhoWaitsLeavesWithTheReason) {
  const Sender stream = sender(1);
  stream.send("never acknowledged").or_throw();
  static_cast<void>(next_data());
  const auto told = [](const Failure& failure) {
    EXPECT_EQ(failure.status, Status::refused) << failure.sentence;
    EXPECT_NE(failure.sentence.find("in the way"), std::string::npos) << failure.sentence;
    EXPECT_EQ(failure.sentence.find("nif_"), std::string::npos) << failure.sentence;
  };
  const std::vector<std::function<void()>> calls{
      [&] { told(node_->receive().failure()); },
      [&] { told(node_->receive(MessageKey{1, 1}).failure()); },
      [&] { told(stream.send("no room").failure()); },
      [&] { EXPECT_FALSE(stream.settle()); },
      [&] { EXPECT_FALSE(node_->ping(Peer{kPeerId}, kForever)); },
      [&] { told(node_->find("anybody", kForever).failure()); },
      [&] { told(node_->watch("**", {}, kForever).failure()); },
      [&] { told(node_->subscribe("a/b", {.timeout = kForever}).failure()); },
  };
  std::vector<std::thread> waiting;
  for (const auto& call : calls) waiting.emplace_back(call);
  hub_.goodbye(GetParam(), "in the way");
  for (std::thread& thread : waiting) thread.join();
  for (const auto& call : calls) call();  // and nobody waits who comes later
  EXPECT_TRUE(node_->state().ended);
  EXPECT_FALSE(node_->state().connected);
  EXPECT_EQ(stream.counts().lost, 1u);
}

TEST_P(Dismissed, WhatCameBeforeStillComes) {
  constexpr int kMessages = 100;
  const Queue queue = node_->queue(kKey, {2, AtFullQueue::stop_reading});
  const std::string text = "x";
  for (int i = 1; i <= kMessages; ++i) {
    answer({static_cast<std::uint32_t>(i), MessageOperation::data, 0, 0},
           std::as_bytes(std::span(text)));
  }
  hub_.goodbye(GetParam(), "in the way");
  for (std::uint32_t i = 1; i <= kMessages; ++i) ASSERT_EQ(queue.receive(kForever)->sequence(), i);
  EXPECT_TRUE(queue.receive(kForever).is(Status::refused));
}

INSTANTIATE_TEST_SUITE_P(Core, Dismissed,
                         testing::Values(GoodbyeCode::kicked, GoodbyeCode::replaced),
                         [](const auto& code) {
                           return std::string(proto::goodbye_name(code.param));
                         });

TEST_F(WithoutReconnecting, ABreakIsTheEnd) {
  std::thread waiting([&] { EXPECT_TRUE(node_->receive().is(Status::not_connected)); });
  hub_.close();
  waiting.join();
  EXPECT_TRUE(node_->state().ended);
  EXPECT_TRUE(node_->ping(Peer{kPeerId}, kForever).is(Status::not_connected));
}

TEST_F(WithoutReconnecting, ANodeThatIsRenumberedComesBackOrSaysThatItCannot) {
  std::thread waiting([&] { EXPECT_FALSE(node_->receive()); });
  hub_.goodbye(GoodbyeCode::renumbered, "you are another");
  auto again = fake_.accept();
  ASSERT_TRUE(again.read_hello());
  EXPECT_FALSE(node_->state().ended);
  again.send(proto::kOpening);
  again.goodbye(GoodbyeCode::hub_full, "no room");
  waiting.join();
  EXPECT_TRUE(node_->state().ended);
}

TEST_F(WithoutReconnecting, ClosingAfterwardsAnswersClosed) {
  hub_.close();
  EXPECT_TRUE(node_->receive().is(Status::not_connected));
  node_->close();
  EXPECT_TRUE(node_->receive().is(Status::closed));
}

TEST_F(Reconnected, AClosedNodeTellsHowItStoodThen) {
  const NodeState before = node_->state();
  node_->close();
  const NodeState after = node_->state();
  EXPECT_EQ(after.peer, before.peer);
  EXPECT_TRUE(after.connected);
  EXPECT_FALSE(after.ended);
  EXPECT_EQ(after.reconnects, before.reconnects);
}

TEST_F(Reconnected, MessagesTellOverWhichConnectionTheyCame) {
  const std::string text = "x";
  for (std::uint32_t connection = 0; connection < 3; ++connection) {
    answer({1, MessageOperation::data, 0, 0}, std::as_bytes(std::span(text)));
    const auto message = node_->receive();
    ASSERT_TRUE(message);
    EXPECT_EQ(message->reconnects(), connection);
    EXPECT_EQ(node_->state().reconnects, connection);
    hub_.close();
    hub_ = fake_.admit(nif::test::make_welcome());
  }
}

TEST_F(Resumed, SaysHowManyMessagesWereNotSentMeanwhile) {
  const ConnectionWatch connection = node_->watch_connection().or_throw();
  EXPECT_EQ(connection.receive()->change, ConnectionChange::connected);
  const Sender stream = sender(0);
  const auto words_after = [&](bool resumed, int unsent) {
    hub_.close();
    EXPECT_EQ(connection.receive()->change, ConnectionChange::lost);
    for (; unsent > 0; --unsent) {
      EXPECT_FALSE(stream.send("x", kNoWait)) << "it may be tried again";
      EXPECT_FALSE(stream.send("x", Timeout{1}));
    }
    proto::Welcome welcome = nif::test::make_welcome(1u << 20);
    welcome.resumed = resumed;
    hub_ = fake_.admit(welcome);
    return connection.receive().or_throw().why;
  };
  const std::string lost = "the hub is back, and what was on its way is lost";
  const std::string goes_on = "the hub is back, and the session goes on";
  EXPECT_EQ(words_after(false, 0), lost);
  EXPECT_EQ(words_after(true, 54), goes_on + "; 54 messages were not sent meanwhile");
  EXPECT_EQ(words_after(false, 1), lost + "; 1 message was not sent meanwhile");
  EXPECT_EQ(words_after(true, 0), goes_on) << "they were told of";
}

TEST_F(Lost, MessagesAreCountedByWhy) {
  EXPECT_EQ(node_->lost().all(), 0u);
  begin_message(1, 20'000);
  begin_message(2, 20'000);
  begin_message(3, 200u << 20);
  const std::string text = "x";
  answer({1, MessageOperation::data, 0, 0}, std::as_bytes(std::span(text)));
  ASSERT_TRUE(node_->receive());
  EXPECT_EQ(node_->lost().incomplete, 2u) << "each was followed by something else";
  EXPECT_EQ(node_->lost().too_large, 1u);
  EXPECT_EQ(node_->lost().frames_broken_off, 0u);
}

TEST_F(Lost, FramesOfOtherNodesThatCannotBeReadAreCounted) {
  proto::FrameParts taken;
  taken.header.kind = proto::Kind::taken;
  taken.header.src = nif::test::kPeerId;
  taken.header.dst = nif::test::kOwnId;
  hub_.send(taken, std::string(proto::kTakenSize - 1, 'x'));
  const std::string text = "x";
  answer({1, MessageOperation::data, 0, 0}, std::as_bytes(std::span(text)));
  ASSERT_TRUE(node_->receive());
  EXPECT_EQ(node_->lost().unreadable, 1u);
  EXPECT_EQ(node_->lost().all(), 1u);
  node_->close();
  EXPECT_EQ(node_->lost().unreadable, 1u);
}

TEST_F(Lost, FramesThatTheHubDroppedAreCountedWithWhoFilledTheQueue) {
  hub_.send(proto::flow::Dropped{proto::DropReason::queue_full, NodeId{9}, 5});
  hub_.send(proto::flow::Dropped{proto::DropReason::over_budget, NodeId{10}, 2});
  const std::string text = "x";
  answer({1, MessageOperation::data, 0, 0}, std::as_bytes(std::span(text)));
  ASSERT_TRUE(node_->receive());
  EXPECT_EQ(node_->lost().queue_full, 5u);
  EXPECT_EQ(node_->lost().queue_filled_by, Peer{9});
  EXPECT_EQ(node_->lost().over_budget, 2u) << "nobody filled this node's queue";
  EXPECT_EQ(node_->lost().all(), 0u) << "those of a subscription are counted there";
}

TEST_F(Lost, MessagesOfNoSubscriptionAreCounted) {
  send_to_group(kGroup);
  send_to_group(kGroup + 1);
  take_one();
  EXPECT_EQ(node_->lost().unknown_service, 2u);
  EXPECT_EQ(node_->lost().all(), 2u);
}

TEST_F(Lost, MessagesOnTheirWayWhenASubscriptionEndedAreNotCounted) {
  std::optional<Subscription> scan;
  std::thread asking([&] { scan.emplace(node_->subscribe("peer/scan").or_throw()); });
  std::uint16_t number = 0;
  ASSERT_TRUE(hub_.next_request<proto::ns::Subscribe>(number));
  proto::ns::SubscribeAnswer answer;
  answer.group = GroupId{kGroup};
  answer.provider = NodeId{kPeerId};
  hub_.send_control(proto::Kind::ns, proto::encode_answer(answer, number));
  asking.join();
  std::thread leaving([&] { scan.reset(); });
  ASSERT_TRUE(hub_.next_request<proto::ns::Unsubscribe>(number));
  send_to_group(kGroup);
  hub_.send_control(proto::Kind::ns, proto::encode_answer(proto::ns::UnsubscribeAnswer{}, number));
  leaving.join();
  send_to_group(kGroup);
  take_one();
  EXPECT_EQ(node_->lost().all(), 0u);
}

TEST_F(Lost, MessagesThatTheHubWillNotSendAgainAreCounted) {
  hub_.send(proto::flow::Skip{proto::DropReason::link_lost, 3});
  hub_.send(proto::flow::Skip{proto::DropReason::link_lost, proto::flow::kSkipUnknown});
  const std::string text = "x";
  answer({1, MessageOperation::data, 0, 0}, std::as_bytes(std::span(text)));
  ASSERT_TRUE(node_->receive());
  EXPECT_EQ(node_->lost().frames_broken_off, 4u) << "at least one, where nobody knows";
}

}  // namespace
}  // namespace gimnet::gimi
