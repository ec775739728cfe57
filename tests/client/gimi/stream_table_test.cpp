#include "client/gimi/stream_table.hpp"

#include <gtest/gtest.h>

#include <optional>
#include <string>
#include <thread>
#include <utility>

#include "proto/control/ns.hpp"
#include "tests/client/gimi/support/conversation.hpp"

// Streams to services as they are seen on the wire, by a hub that answers what the test wants.

namespace gimnet::gimi {
namespace {

using test::Conversation;
using test::kAll;
using test::kKey;
using test::kOwnId;
using test::kPeerId;
using test::MessageOperation;
using test::Taken;

namespace ns = proto::ns;

constexpr std::uint32_t kGroup = (7u << 20) | 300;
constexpr std::uint32_t kNewGroup = (7u << 20) | 301;
constexpr const char* kService = "robot/drive";

class StreamTableTest : public Conversation {
 protected:
  /// Answers the one question with one service, and the other with where it is.
  void serve(ns::Direction direction = ns::Direction::accepts) {
    std::uint16_t number = 0;
    ASSERT_TRUE(hub_.next_request<ns::ServicesRequest>(number));
    ns::ServicesAnswer listed;
    listed.services.resize(1);
    listed.services[0].group = GroupId{kGroup};
    listed.services[0].name = kService;
    listed.services[0].node = NodeId{kPeerId};
    listed.services[0].direction = direction;
    hub_.send_control(proto::Kind::ns, proto::encode_answer(listed, number));
    if (direction != ns::Direction::accepts) return;
    const auto subscribe = hub_.next_request<ns::Subscribe>(number);
    ASSERT_TRUE(subscribe);
    EXPECT_EQ(subscribe->name, kService);
    ns::SubscribeAnswer subscribed;
    subscribed.group = GroupId{kGroup};
    subscribed.provider = NodeId{kPeerId};
    subscribed.message_type = kKey.type;
    subscribed.instance = kKey.instance;
    hub_.send_control(proto::Kind::ns, proto::encode_answer(subscribed, number));
  }

  [[nodiscard]] Sender to_service(std::size_t window, AtFullWindow at_full = AtFullWindow::wait) {
    SendOptions options;
    options.window = window;
    options.at_full = at_full;
    options.key = {9, 9};  // the service's own counts
    std::optional<Sender> made;
    std::thread asking([&] { made.emplace(node_->sender(kService, options).or_throw()); });
    serve();
    asking.join();
    return *made;
  }

  /// `provider` 0: nobody provides it any more.
  void move_to(std::uint32_t group, MessageKey key = kKey, std::uint32_t provider = kPeerId,
               std::uint64_t session = 0) {
    ns::ServiceMoved moved;
    moved.name = kService;
    moved.group = GroupId{group};
    moved.provider = NodeId{provider};
    moved.session = session;
    moved.message_type = key.type;
    moved.instance = key.instance;
    hub_.send_control(proto::Kind::ns, proto::encode(moved));
  }

  /// Returns when the node has handled everything that the hub said before.
  void settle_down() {
    answer({++sequence_, MessageOperation::data, 0, 0}, {});
    EXPECT_EQ(node_->receive(kKey, kForever)->sequence(), sequence_);
  }

  std::uint32_t sequence_ = 0;
};

TEST_F(StreamTableTest, AServiceIsAddressedByItsGroupAndItsKey) {
  const Sender drive = to_service(1);
  EXPECT_EQ(drive.service(), kService);
  EXPECT_FALSE(drive.peer());
  drive.send("go").or_throw();
  const Taken taken = next_data();
  EXPECT_EQ(taken.data, "go");
  EXPECT_EQ(taken.frame.kind, proto::Kind::service);
  EXPECT_EQ(taken.frame.dst, kGroup);
  EXPECT_TRUE(taken.frame.has(proto::kFlagReport));
  EXPECT_TRUE(taken.header.has(proto::gimi::kFlagAckWanted));
}

TEST_F(StreamTableTest, AnAckThatNamesTheGroupFreesAndOneToTheNodeDoesNot) {
  const Sender drive = to_service(1);
  const Sender direct = sender(1);
  drive.send("to the service").or_throw();
  static_cast<void>(next_data());
  acknowledge(1, kAll, 0, kGroup);
  drive.settle().or_throw();
  direct.send("to the node").or_throw();
  static_cast<void>(next_data());
  acknowledge(1, kAll, 0, kGroup);
  settle_down();
  EXPECT_EQ(direct.counts().acknowledged, 0u)
      << "another stream, though key and receiver are the same";
  acknowledge(1, kAll);
  direct.settle().or_throw();
  EXPECT_EQ(drive.counts().acknowledged, 1u);
}

TEST_F(StreamTableTest, AsksTheServiceForMissingAcks) {
  const Sender drive = to_service(1);
  drive.send("go").or_throw();
  static_cast<void>(next_data());
  const Taken ping = next();
  EXPECT_EQ(ping.header.operation, MessageOperation::ping);
  EXPECT_EQ(ping.frame.kind, proto::Kind::service);
  EXPECT_EQ(ping.frame.dst, kGroup);
  acknowledge(1, kAll, ping.header.sequence, kGroup);
  drive.settle().or_throw();
}

TEST_F(StreamTableTest, APauseHoldsItsKindDestinationAndLaneOnly) {
  const Sender drive = to_service(0);
  const Sender direct = sender(0);
  const proto::flow::Target target{proto::Kind::service, proto::Lane::normal, kGroup};
  hub_.send(proto::flow::Pause{target});
  settle_down();
  EXPECT_TRUE(drive.send("too early", kNoWait).is(Status::timeout)) << "it waits";
  direct.send("past it").or_throw();
  node_->send(Peer{kPeerId}, "and past it").or_throw();
  EXPECT_EQ(next_data().data, "past it");
  EXPECT_EQ(next_data().data, "and past it");
  std::thread waiting([&] { drive.send("afterwards").or_throw(); });
  hub_.send(proto::flow::Resume{target});
  const Taken taken = next_data();
  waiting.join();
  EXPECT_EQ(taken.data, "afterwards");
  EXPECT_EQ(taken.frame.dst, kGroup);
}

TEST_F(StreamTableTest, FollowsAServiceThatMoves) {
  const Sender drive = to_service(2);
  drive.send("lost").or_throw();
  static_cast<void>(next_data());
  constexpr MessageKey kOther{6, 0};
  move_to(kNewGroup, kOther);
  settle_down();
  const auto settled = drive.settle();
  EXPECT_TRUE(settled.is(Status::not_delivered)) << "its former place cannot tell any more";
  EXPECT_EQ(drive.counts().lost, 1u);
  drive.send("found").or_throw();
  const auto frame = next_data_frame();
  ASSERT_TRUE(frame);
  EXPECT_EQ(taken_of(*frame).data, "found");
  EXPECT_EQ(frame->header.dst, kNewGroup);
  EXPECT_EQ(frame->view().key, (proto::gimi::StreamKey{kOther.type, kOther.instance}.value()));
  acknowledge(2, 0, 0, kGroup);
  settle_down();
  EXPECT_EQ(drive.counts().acknowledged, 0u) << "an answer from the former place";
  acknowledge(2, 0, 0, kNewGroup);
  EXPECT_TRUE(drive.settle().is(Status::not_delivered)) << "the one";
  EXPECT_EQ(drive.counts().acknowledged, 1u);
}

TEST_F(StreamTableTest, AnotherSessionOfTheProviderKnowsNothingOfWhatWasOnItsWay) {
  const Sender drive = to_service(2);
  drive.send("lost").or_throw();
  static_cast<void>(next_data());
  move_to(kGroup, kKey, kPeerId, 9);
  settle_down();
  EXPECT_TRUE(drive.settle().is(Status::not_delivered));
  EXPECT_EQ(drive.counts().lost, 1u);
  drive.send("found").or_throw();
  EXPECT_EQ(next_data().frame.dst, kGroup);
  move_to(kGroup, kKey, kPeerId, 9);
  settle_down();
  acknowledge(2, 0, 0, kGroup);
  EXPECT_TRUE(drive.settle().is(Status::not_delivered)) << "the first one";
  EXPECT_EQ(drive.counts().acknowledged, 1u) << "the same session: nothing was lost";
}

TEST_F(StreamTableTest, SaysThatNobodyHasTheServiceUntilItIsBack) {
  const Sender drive = to_service(1, AtFullWindow::hold_latest);
  drive.send("waits for its ACK").or_throw();
  drive.send("held").or_throw();
  move_to(kGroup, kKey, 0);
  settle_down();
  EXPECT_TRUE(drive.send("x").is(Status::not_found));
  EXPECT_NE(drive.send("x").failure().sentence.find(kService), std::string::npos);
  EXPECT_EQ(drive.counts().lost, 2u);
  EXPECT_EQ(drive.counts().waiting, 0u);
  move_to(kNewGroup);
  settle_down();
  drive.send("back").or_throw();
  Taken taken = next_data();
  while (taken.data != "back") taken = next_data();
  EXPECT_EQ(taken.frame.dst, kNewGroup);
}

TEST_F(StreamTableTest, AReportThatTheGroupIsGoneFreesEverything) {
  const Sender drive = to_service(3);
  drive.send("1").or_throw();
  drive.send("2").or_throw();
  const auto frame = next_data_frame();
  ASSERT_TRUE(frame);
  report(proto::DropReason::no_such_group, 1, *frame);
  EXPECT_TRUE(drive.settle().is(Status::not_delivered));
  EXPECT_EQ(drive.counts().lost, 2u);
  EXPECT_EQ(drive.counts().loss_reason, LossReason::no_such_group) << drive.counts().loss;
}

TEST_F(StreamTableTest, OneStreamForAllWhoSendToAService) {
  const Sender first = to_service(5);
  const Sender second = node_->sender(kService, {.window = 5}).or_throw();  // asks nobody
  second.send("x").or_throw();
  EXPECT_EQ(first.counts().sent, 1u);
}

TEST_F(StreamTableTest, AServiceThatGivesDataTakesNone) {
  std::thread asking([&] {
    const auto refused = node_->sender(kService);
    EXPECT_TRUE(refused.is(Status::not_found));
    EXPECT_NE(refused.failure().sentence.find("subscribe"), std::string::npos);
  });
  serve(ns::Direction::provides);
  asking.join();
}

TEST_F(StreamTableTest, AcknowledgesWhatCameForAServiceInItsName) {
  proto::FrameParts parts;
  parts.header.kind = proto::Kind::service;
  parts.header.dst = kGroup;
  parts.header.src = kPeerId;
  parts.key = proto::gimi::StreamKey{kKey.type, kKey.instance}.value();
  std::string payload(proto::gimi::kMessageHeaderSize, '\0');
  payload[4] = 1;                                               // sequence 1
  payload[9] = static_cast<char>(proto::gimi::kFlagAckWanted);  // of DATA
  std::optional<Accepted> accepted;
  std::thread accepting([&] { accepted.emplace(node_->accept("go", {.key = kKey}).or_throw()); });
  std::uint16_t number = 0;
  EXPECT_TRUE(hub_.next_request<ns::Advertise>(number));
  hub_.send_control(proto::Kind::ns,
                    proto::encode_answer(ns::AdvertiseAnswer{GroupId{kGroup}}, number));
  accepting.join();
  hub_.send(parts, payload + "go");
  const Taken ack = next();
  EXPECT_EQ(ack.header.operation, MessageOperation::ack);
  EXPECT_EQ(ack.frame.kind, proto::Kind::unicast);
  EXPECT_EQ(ack.frame.dst, kPeerId);
  const auto read =
      proto::gimi::decode_ack(std::as_bytes(std::span(ack.data.data(), ack.data.size())));
  ASSERT_TRUE(read);
  EXPECT_EQ(read->group, kGroup);
  EXPECT_EQ(accepted->receive(kForever)->text(), "go");
}

}  // namespace
}  // namespace gimnet::gimi
