#include "client/nif/handshake.hpp"

#include <gtest/gtest.h>

#include <string>
#include <vector>

#include "tests/client/nif/support/fake_hub.hpp"
#include "tests/client/nif/support/recording_host.hpp"

namespace gimnet::nif::test {
namespace {

std::vector<std::byte> answer(const proto::Payload& payload) {
  std::vector<std::byte> bytes(proto::kOpening.begin(), proto::kOpening.end());
  add_control(bytes, proto::Kind::link, payload);
  return bytes;
}

Handshake::State feed(Handshake& handshake, std::span<const std::byte> bytes,
                      std::size_t step = SIZE_MAX) {
  auto state = Handshake::State::need_more;
  while (state == Handshake::State::need_more && !bytes.empty()) {
    const std::size_t size = std::min(step, bytes.size());
    state = handshake.take(bytes.first(size));
    bytes = bytes.subspan(size);
  }
  return state;
}

Handshake::State welcome_with(proto::Welcome welcome, bool resume = true, std::uint64_t epoch = 0) {
  Handshake handshake(resume, epoch);
  return feed(handshake, answer(proto::encode(welcome)));
}

TEST(Handshake, TakesWelcomeHoweverItIsSplitAndKeepsTheRest) {
  std::vector<std::byte> bytes = answer(proto::encode(make_welcome(1000)));
  const std::size_t end = bytes.size();
  bytes.push_back(std::byte{1});
  for (std::size_t step = 1; step <= bytes.size(); ++step) {
    Handshake handshake(true, 0);
    ASSERT_EQ(feed(handshake, bytes, step), Handshake::State::welcome) << step;
    EXPECT_EQ(handshake.session().id, kOwnId);
    EXPECT_EQ(handshake.session().name, "robot");
    EXPECT_TRUE(handshake.session().resume);
    EXPECT_FALSE(handshake.session().resumed);
    EXPECT_LE(handshake.rest().size(), step == 1 || end % step == 0 ? 0u : 1u);
  }
}

TEST(Handshake, TakesGoodbye) {
  Handshake handshake(false, 0);
  ASSERT_EQ(feed(handshake,
                 answer(proto::encode(proto::Goodbye{proto::GoodbyeCode::name_taken, "by 7.3"}))),
            Handshake::State::goodbye);
  EXPECT_EQ(handshake.goodbye().sentence, "by 7.3");
  EXPECT_EQ(status_of(handshake.goodbye().code), NIF_NAME_TAKEN);
}

TEST(Handshake, RefusesOtherProtocolsAtTheFirstWrongByte) {
  Handshake http(false, 0);
  EXPECT_EQ(feed(http, std::as_bytes(std::span(std::string_view("H")))), Handshake::State::failed);
  EXPECT_EQ(http.failure().status, NIF_PROTOCOL);
  Handshake version(false, 0);
  EXPECT_EQ(feed(version, std::as_bytes(std::span(std::string_view("GIMnet\x02\x00", 8)))),
            Handshake::State::failed);
  EXPECT_EQ(version.failure().status, NIF_BAD_VERSION);
}

TEST(Handshake, RefusesImpossibleWelcomes) {
  EXPECT_EQ(welcome_with(make_welcome()), Handshake::State::welcome);
  const auto with = [](auto change) {
    proto::Welcome welcome = make_welcome();
    change(welcome);
    return welcome_with(welcome);
  };
  EXPECT_EQ(with([](auto& w) { w.node = NodeId{0}; }), Handshake::State::failed);
  EXPECT_EQ(with([](auto& w) { w.node = NodeId{kHubNode}; }), Handshake::State::failed)
      << "the hub itself";
  EXPECT_EQ(with([](auto& w) { w.node = NodeId{0xFFFFFFFF}; }), Handshake::State::failed);
  EXPECT_EQ(with([](auto& w) { w.hub = HubId{8}; }), Handshake::State::failed)
      << "an id of another hub";
  EXPECT_EQ(with([](auto& w) { w.token.clear(); }), Handshake::State::failed);
  EXPECT_EQ(with([](auto& w) { w.frame_length_max = 16 * 1024 - 1; }), Handshake::State::failed);
  EXPECT_EQ(with([](auto& w) { w.frame_length_max = 16 * 1024; }), Handshake::State::welcome);
}

TEST(Handshake, BoundsWhatTheHubAsksFor) {
  proto::Welcome welcome = make_welcome();
  welcome.frame_length_max = 1u << 20;
  welcome.keep_alive_ms = 0;
  welcome.silent_ms = 0xFFFFFFFF;
  Handshake handshake(false, 0);
  ASSERT_EQ(feed(handshake, answer(proto::encode(welcome))), Handshake::State::welcome);
  EXPECT_EQ(handshake.session().frame_bytes_max, 65'536u);
  EXPECT_EQ(handshake.session().keep_alive_ns, 1'000 * kNsPerMs);
  EXPECT_LE(handshake.session().silent_after_ns, 120'000 * kNsPerMs);
}

TEST(Handshake, ResumesOnlyWhatItAskedFor) {
  proto::Welcome welcome = make_welcome(1000);
  welcome.resumed = true;
  welcome.taken = 5;
  Handshake resumed(true, welcome.epoch);
  ASSERT_EQ(feed(resumed, answer(proto::encode(welcome))), Handshake::State::welcome);
  EXPECT_TRUE(resumed.session().resumed);
  EXPECT_EQ(resumed.session().hub_taken, 5u);
  Handshake fresh(true, 0);
  ASSERT_EQ(feed(fresh, answer(proto::encode(welcome))), Handshake::State::welcome);
  EXPECT_FALSE(fresh.session().resumed);
  EXPECT_EQ(welcome_with(welcome, true, welcome.epoch + 1), Handshake::State::failed);
}

TEST(Handshake, RefusesEveryOtherFrame) {
  for (unsigned kind = 0; kind < 256; ++kind) {
    if (kind == static_cast<unsigned>(proto::Kind::link)) continue;
    std::vector<std::byte> bytes(proto::kOpening.begin(), proto::kOpening.end());
    proto::FrameParts parts;
    parts.header.kind = static_cast<proto::Kind>(kind);
    add_frame(bytes, parts, "");
    Handshake handshake(false, 0);
    EXPECT_EQ(feed(handshake, bytes), Handshake::State::failed) << kind;
  }
  Handshake hello(false, 0);
  EXPECT_EQ(feed(hello, answer(proto::encode(proto::Hello{}))), Handshake::State::failed);
}

TEST(Handshake, DoesNotWaitForAnAnswerThatNeverEnds) {
  std::vector<std::byte> bytes(proto::kOpening.begin(), proto::kOpening.end());
  proto::FrameHeader header;
  header.kind = proto::Kind::link;
  header.length = 0xFFFFFFFF;
  bytes.resize(bytes.size() + proto::kHeaderSize);
  proto::store_header(bytes.data() + proto::kOpeningSize, header);
  Handshake handshake(false, 0);
  EXPECT_EQ(feed(handshake, bytes), Handshake::State::failed);
}

}  // namespace
}  // namespace gimnet::nif::test
