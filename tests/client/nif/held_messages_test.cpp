#include "client/nif/held_messages.hpp"

#include <gtest/gtest.h>

#include <array>
#include <atomic>
#include <string>
#include <thread>

#include "tests/client/nif/support/fake_hub.hpp"

// A message that has begun goes on when its sender does not wait any more.

namespace gimnet::nif::test {
namespace {

constexpr std::uint32_t kOther = (7u << 20) | 101;
constexpr std::size_t kSendQueue = 256 * 1024;

nif_outgoing message_of(const nif_bytes& part, std::uint32_t to) {
  nif_outgoing message = NIF_OUTGOING_INIT;
  message.to = to;
  message.parts = &part;
  message.part_count = 1;
  return message;
}

nif_status send(nif_node* node, std::uint32_t to, std::string_view payload, std::int32_t timeout_ms,
                std::uint8_t flags = 0) {
  const nif_bytes part = {payload.data(), payload.size()};
  nif_outgoing message = message_of(part, to);
  message.flags = flags;
  return nif_send(node, &message, timeout_ms);
}

void send_taken(FakeConnection& hub, std::uint32_t from, const proto::Taken& taken) {
  std::array<std::byte, proto::kTakenSize> payload;
  proto::encode_taken(taken, payload);
  proto::FrameParts parts;
  parts.header.kind = proto::Kind::taken;
  parts.header.src = from;
  parts.header.dst = kOwnId;
  hub.send(parts, {reinterpret_cast<const char*>(payload.data()), payload.size()});
}

/// The payload of messages to `to` until there are so many bytes; other frames but TAKEN are wrong.
std::string read_message(FakeConnection& hub, std::uint32_t to, std::size_t bytes) {
  std::string received;
  while (received.size() < bytes) {
    const auto frame = hub.next_message();
    if (!frame) break;
    if (frame->header.kind == proto::Kind::taken) continue;
    EXPECT_EQ(frame->header.dst, to);
    received += frame->payload();
  }
  return received;
}

TEST(HeldMessages, CountWhatTheyKeep) {
  HeldMessages held(100);
  EXPECT_TRUE(held.has_place(1'000)) << "one alone may have any size";
  const std::string payload(60, 'x');
  const nif_bytes part{payload.data(), payload.size()};
  Outgoing message;
  ASSERT_FALSE(message.read(message_of(part, kPeerId)));
  proto::Fragmenter fragmenter(60, 10);
  static_cast<void>(fragmenter.next());
  const HeldMessage& first = held.hold(message, {}, fragmenter);
  EXPECT_EQ(held.bytes(), 50u);
  EXPECT_TRUE(held.has_place(50));
  EXPECT_FALSE(held.has_place(51));
  EXPECT_EQ(first.message->size(), 60u);
  EXPECT_EQ(held.erase(held.begin()), held.end());
  EXPECT_EQ(held.bytes(), 0u);
  EXPECT_TRUE(held.empty());
}

TEST(HeldMessages, AreMadeOfTheRestOfTheSameMessage) {
  const std::string first = pattern(10, 1);
  const std::string second = pattern(30, 2);
  const std::array<nif_bytes, 2> given{nif_bytes{first.data(), first.size()},
                                       nif_bytes{second.data(), second.size()}};
  const std::array<std::uint32_t, 2> recipients{kOther, kPeerId};
  nif_outgoing outgoing = NIF_OUTGOING_INIT;
  outgoing.kind = NIF_LIST;
  outgoing.recipients = recipients.data();
  outgoing.recipient_count = recipients.size();
  outgoing.flags = NIF_FLAG_KEYED;
  outgoing.key = 77;
  outgoing.trace_slots = 1;
  outgoing.parts = given.data();
  outgoing.part_count = given.size();
  Outgoing message;
  ASSERT_FALSE(message.read(outgoing));
  const auto frame_of = [&](Outgoing& from) {
    std::vector<std::byte> frame(proto::prefix_size(message.parts()) + proto::kFragmentHeaderSize +
                                 20);
    from.write_frame(frame, kOwnId, proto::FragmentHeader{1, 15, 40}, 15, 20, false);
    return frame;
  };
  const auto whole = frame_of(message);
  EXPECT_EQ(frame_of(*message.copy_rest(15)), whole);
  EXPECT_EQ(frame_of(*message.copy_rest(7)), whole);
}

TEST(HeldMessages, GoOnAfterAnImpatientSender) {
  FakeHub hub;
  Connected connected = connect_to(hub, default_options(), make_welcome());
  nif_node* const node = connected.node.get();
  const std::string payload = pattern(3u << 20);
  ASSERT_EQ(send(node, kPeerId, payload, 0), NIF_OK) << "the whole message";
  EXPECT_EQ(send(node, kPeerId, "another in the same stream", 0), NIF_TIMEOUT);
  EXPECT_EQ(send(node, kOther, pattern(kSendQueue), 0), NIF_TIMEOUT) << "nor is one taken in part";
  EXPECT_EQ(nif_drain(node, 0), NIF_TIMEOUT);
  EXPECT_GT(counters_of(node).send_queue_bytes, 1u << 20);
  std::string received = read_message(connected.hub, kPeerId, proto::kWindowDefault);
  EXPECT_EQ(received.size(), proto::kWindowDefault) << "not a byte more before the first TAKEN";
  EXPECT_EQ(send(node, kOther, "quick", NIF_FOREVER), NIF_OK);
  EXPECT_EQ(read_message(connected.hub, kOther, 5), "quick");
  while (received.size() < payload.size()) {
    const auto size = static_cast<std::uint32_t>(received.size());
    const std::uint32_t allowed =
        std::min<std::uint32_t>(size + 500'000, static_cast<std::uint32_t>(payload.size()));
    send_taken(connected.hub, kPeerId, {1, size, allowed});
    received += read_message(connected.hub, kPeerId, allowed - size);
  }
  EXPECT_TRUE(received == payload);
  EXPECT_EQ(send(node, kPeerId, "the next", NIF_FOREVER), NIF_OK);
  EXPECT_EQ(read_message(connected.hub, kPeerId, 8), "the next");
  EXPECT_EQ(nif_drain(node, NIF_FOREVER), NIF_OK);
}

/// Answers each message with a larger one, to the node that it came from.
struct Answering {
  std::string answer;
  std::atomic<nif_node*> node{nullptr};
  std::atomic<int> refused{0};

  static nif_verdict on_incoming(void* user, const nif_incoming* in) {
    auto* self = static_cast<Answering*>(user);
    if (in->type != NIF_MESSAGE) return NIF_DONE;
    while (self->node == nullptr) std::this_thread::yield();
    if (send(self->node, in->from, self->answer, NIF_FOREVER) != NIF_OK) ++self->refused;
    return NIF_DONE;
  }
};

TEST(HeldMessages, ACallbackAnswersWithMoreThanTheSendQueueTakes) {
  Answering answering{.answer = pattern(1u << 20)};
  FakeHub hub;
  nif_options options = default_options();
  options.callback = &Answering::on_incoming;
  options.user = &answering;
  Connected connected = connect_to(hub, options, make_welcome());
  answering.node = connected.node.get();
  for (int i = 0; i < 5; ++i) {
    connected.hub.send_unicast(kPeerId, kOwnId, "question");
    EXPECT_TRUE(read_message(connected.hub, kPeerId, answering.answer.size()) == answering.answer);
  }
  EXPECT_EQ(answering.refused, 0);
}

TEST(HeldMessages, WhatTheReceiverRefusesIsReported) {
  FakeHub hub;
  Connected connected = connect_to(hub, default_options(), make_welcome());
  nif_node* const node = connected.node.get();
  ASSERT_EQ(send(node, kPeerId, pattern(3u << 20), 0, NIF_FLAG_REPORT), NIF_OK);
  EXPECT_EQ(read_message(connected.hub, kPeerId, proto::kWindowDefault).size(),
            proto::kWindowDefault);
  send_taken(connected.hub, kPeerId, {1, 0, 0});
  nif_incoming in{};
  ASSERT_EQ(nif_receive(node, &in, NIF_FOREVER), NIF_OK);
  EXPECT_EQ(in.type, static_cast<std::uint32_t>(NIF_REPORT));
  EXPECT_EQ(in.reason, static_cast<std::uint32_t>(NIF_DROP_TOO_LARGE));
  EXPECT_EQ(in.to, kPeerId);
  EXPECT_EQ(in.count, 1u);
  nif_release(&in);
  ASSERT_EQ(send(node, kPeerId, "the next", NIF_FOREVER), NIF_OK);
  EXPECT_EQ(read_message(connected.hub, kPeerId, 8), "the next");
}

TEST(HeldMessages, AreGoneWithTheirConnection) {
  FakeHub hub;
  Connected connected = connect_to(hub, default_options(), make_welcome());
  nif_node* const node = connected.node.get();
  ASSERT_EQ(send(node, kPeerId, pattern(3u << 20), 0), NIF_OK);
  connected.hub.close();
  connected.hub = hub.admit(make_welcome());
  while (info_of(node).reconnects == 0) std::this_thread::yield();
  EXPECT_EQ(nif_drain(node, NIF_FOREVER), NIF_NOT_CONNECTED) << "it is lost";
  EXPECT_EQ(counters_of(node).send_queue_bytes, 0u);
  ASSERT_EQ(send(node, kPeerId, "the next", NIF_FOREVER), NIF_OK);
  EXPECT_EQ(read_message(connected.hub, kPeerId, 8), "the next");
}

TEST(HeldMessages, AreWrittenBeforeTheGoodbye) {
  FakeHub hub;
  Connected connected = connect_to(hub, default_options(), make_welcome());
  const std::string payload = pattern(1u << 20);
  ASSERT_EQ(send(connected.node.get(), kPeerId, payload, 0), NIF_OK);
  std::thread closing([&] { EXPECT_EQ(nif_close(connected.node.release()), NIF_OK); });
  EXPECT_TRUE(read_message(connected.hub, kPeerId, payload.size()) == payload);
  const auto last = connected.hub.next_message();
  ASSERT_TRUE(last);
  EXPECT_EQ(last->header.kind, proto::Kind::link);
  connected.hub.close();
  closing.join();
}

}  // namespace
}  // namespace gimnet::nif::test
