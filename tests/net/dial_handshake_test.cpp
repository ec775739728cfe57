#include "net/dial_handshake.hpp"

#include <gtest/gtest.h>

#include <string>
#include <string_view>
#include <vector>

#include "proto/frame/frame_header.hpp"
#include "tests/net/support/link_frames.hpp"

namespace gimnet::net {
namespace {

using State = DialHandshake::State;

proto::Welcome some_welcome() {
  proto::Welcome welcome;
  welcome.node = NodeId{(7u << 20) | 17};
  welcome.hub = HubId{7};
  welcome.name = "robot";
  welcome.token.assign(proto::kTokenBytesMax, std::byte{1});
  return welcome;
}

State feed(DialHandshake& handshake, std::span<const std::byte> bytes,
           std::size_t step = SIZE_MAX) {
  auto state = State::need_more;
  while (state == State::need_more && !bytes.empty()) {
    const std::size_t size = std::min(step, bytes.size());
    state = handshake.take(bytes.first(size));
    bytes = bytes.subspan(size);
  }
  return state;
}

State feed(DialHandshake& handshake, std::string_view text) {
  return feed(handshake, std::as_bytes(std::span(text)));
}

TEST(DialHandshake, TakesWelcomeHoweverItIsSplit) {
  std::vector<std::byte> bytes = opening_and(some_welcome());
  bytes.push_back(std::byte{1});
  for (std::size_t step = 1; step <= bytes.size(); ++step) {
    DialHandshake handshake;
    ASSERT_EQ(feed(handshake, bytes, step), State::welcome) << step;
    EXPECT_EQ(handshake.welcome(), some_welcome());
  }
}

TEST(DialHandshake, TakesGoodbye) {
  DialHandshake handshake;
  const proto::Goodbye goodbye{proto::GoodbyeCode::name_taken, "by 7.3"};
  ASSERT_EQ(feed(handshake, opening_and(goodbye)), State::goodbye);
  EXPECT_EQ(handshake.goodbye().code, proto::GoodbyeCode::name_taken);
  EXPECT_EQ(handshake.goodbye().sentence, "by 7.3");
}

TEST(DialHandshake, RefusesOtherProtocolsAtTheFirstWrongByte) {
  DialHandshake http;
  EXPECT_EQ(feed(http, "H"), State::failed);
  EXPECT_EQ(http.error().fault, Fault::protocol);
  DialHandshake version;
  EXPECT_EQ(feed(version, std::string_view("GIMnet\x02\x00", 8)), State::failed);
  EXPECT_EQ(version.error().fault, Fault::bad_version);
}

TEST(DialHandshake, RefusesEveryOtherFrame) {
  for (unsigned kind = 0; kind < 256; ++kind) {
    if (kind == static_cast<unsigned>(proto::Kind::link)) continue;
    std::vector<std::byte> bytes(proto::kOpening.begin(), proto::kOpening.end());
    proto::FrameHeader header;
    header.kind = static_cast<proto::Kind>(kind);
    bytes.resize(bytes.size() + proto::kHeaderSize);
    proto::store_header(bytes.data() + proto::kOpeningSize, header);
    DialHandshake handshake;
    EXPECT_EQ(feed(handshake, bytes), State::failed) << kind;
  }
  DialHandshake hello;
  EXPECT_EQ(feed(hello, opening_and(proto::Hello{})), State::failed);
}

TEST(DialHandshake, DoesNotWaitForAnAnswerThatNeverEnds) {
  std::vector<std::byte> bytes(proto::kOpening.begin(), proto::kOpening.end());
  proto::FrameHeader header;
  header.kind = proto::Kind::link;
  header.length = 0xFFFFFFFF;
  bytes.resize(bytes.size() + proto::kHeaderSize);
  proto::store_header(bytes.data() + proto::kOpeningSize, header);
  DialHandshake handshake;
  EXPECT_EQ(feed(handshake, bytes), State::failed);
}

}  // namespace
}  // namespace gimnet::net
