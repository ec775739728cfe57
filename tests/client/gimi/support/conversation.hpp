#pragma once

#include <gtest/gtest.h>

#include <array>
#include <optional>
#include <span>
#include <string>
#include <thread>

#include "gimnet/gimi.hpp"
#include "proto/gimi/message_header.hpp"
#include "tests/client/nif/support/fake_hub.hpp"

// A node of GIMI, and the hub's end of its connection, which says what the test wants.

namespace gimnet::gimi::test {

using nif::test::FakeConnection;
using nif::test::FakeHub;
using nif::test::Frame;
using nif::test::kHubNode;
using nif::test::kOwnId;
using nif::test::kPeerId;
using proto::gimi::MessageOperation;

inline constexpr MessageKey kKey{3, 4};
inline constexpr std::uint64_t kAll = ~std::uint64_t{0};

/// A GIMI message in a frame.
struct Taken {
  proto::gimi::MessageHeader header;
  std::string data;
  proto::FrameHeader frame;
};

class Conversation : public testing::Test {
 protected:
  /// `resume`: its session goes on after a break, if the hub says so.
  explicit Conversation(bool reconnect = false, bool resume = false) {
    NodeOptions options;
    options.hub = fake_.url();
    options.reconnect = reconnect;
    if (resume) options.resume = true;
    std::thread joiner([&] { node_.emplace(Node::join(options).or_throw()); });
    hub_ = fake_.admit(nif::test::make_welcome(resume ? 1u << 20 : 0));
    joiner.join();
  }
  ~Conversation() override { hub_.close(); }

  [[nodiscard]] Sender sender(std::size_t window, AtFullWindow at_full = AtFullWindow::wait) {
    SendOptions options;
    options.key = kKey;
    options.window = window;
    options.at_full = at_full;
    return node_->sender(Peer{kPeerId}, options).or_throw();
  }

  /// The next message of any kind.
  Taken next() {
    const auto frame = hub_.next_message();
    EXPECT_TRUE(frame.has_value());
    return frame ? taken_of(*frame) : Taken{};
  }
  /// The next DATA. A stream that waits long enough for an ACK asks for it, at any place in
  /// between.
  Taken next_data() {
    const auto frame = next_data_frame();
    return frame ? taken_of(*frame) : Taken{};
  }
  std::optional<Frame> next_data_frame() {
    for (;;) {
      auto frame = hub_.next_message();
      EXPECT_TRUE(frame.has_value());
      if (!frame || taken_of(*frame).header.operation != MessageOperation::ping) return frame;
    }
  }

  Taken taken_of(const Frame& frame) {
    const auto view = frame.view();
    EXPECT_TRUE(view.key.has_value());
    const auto message = proto::gimi::parse_message(view.payload);
    EXPECT_TRUE(message.has_value());
    if (!message) return {};
    epoch_ = message->header.epoch;
    return {message->header,
            {reinterpret_cast<const char*>(message->data.data()), message->data.size()},
            frame.header};
  }

  /// A DATA, or the answer to what came last.
  void answer(proto::gimi::MessageHeader header, std::span<const std::byte> data,
              std::uint32_t from = kPeerId) {
    if (header.operation != MessageOperation::data && header.epoch == 0) header.epoch = epoch_;
    std::array<std::byte, proto::gimi::kMessagePrefixMax> prefix;
    const std::size_t size = proto::gimi::write_message_prefix(header, std::nullopt, prefix);
    std::string payload(reinterpret_cast<const char*>(prefix.data()), size);
    payload.append(reinterpret_cast<const char*>(data.data()), data.size());
    proto::FrameParts parts;
    parts.header.kind = proto::Kind::unicast;
    parts.header.dst = kOwnId;
    parts.header.src = from;
    parts.key = proto::gimi::StreamKey{kKey.type, kKey.instance}.value();
    hub_.send(parts, payload);
  }
  void acknowledge(std::uint32_t sequence, std::uint64_t bitmap = kAll, std::uint32_t pong = 0,
                   std::uint32_t group = 0) {
    std::array<std::byte, proto::gimi::kAckSizeMax> data;
    const std::size_t size = proto::gimi::encode_ack({bitmap, pong, group}, data);
    answer({sequence, MessageOperation::ack, 0, 0}, std::span(data).first(size));
  }
  void report(proto::DropReason reason, std::uint32_t count, const Frame& frame) {
    std::string payload{static_cast<char>(reason), 0, 0, 0};
    payload.append(reinterpret_cast<const char*>(&count), sizeof count);
    const std::size_t size = std::min<std::size_t>(frame.bytes.size(), 36);
    payload.append(reinterpret_cast<const char*>(frame.bytes.data()), size);
    proto::FrameParts parts;
    parts.header.kind = proto::Kind::report;
    parts.header.dst = kOwnId;
    parts.header.src = kHubNode;
    hub_.send(parts, payload);
  }

  std::uint32_t epoch_ = 0;  ///< of the stream of what came last
  FakeHub fake_;
  FakeConnection hub_{-1};
  std::optional<Node> node_;
};

}  // namespace gimnet::gimi::test
