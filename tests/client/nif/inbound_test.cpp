#include "client/nif/inbound.hpp"

#include <gtest/gtest.h>

#include <string>
#include <vector>

#include "tests/client/nif/support/fake_hub.hpp"
#include "tests/client/nif/support/recording_host.hpp"

namespace gimnet::nif::test {
namespace {

proto::FrameParts from_peer(proto::Kind kind = proto::Kind::unicast, std::uint32_t dst = kOwnId) {
  proto::FrameParts parts;
  parts.header.kind = kind;
  parts.header.src = kPeerId;
  parts.header.dst = dst;
  return parts;
}

proto::FrameParts fragment(std::uint32_t message, std::uint32_t offset, std::uint32_t total) {
  proto::FrameParts parts = from_peer();
  parts.fragment = proto::FragmentHeader{message, offset, total};
  return parts;
}

TEST(Inbound, GivesOutMessagesHoweverTheBytesAreSplit) {
  std::vector<std::byte> bytes;
  for (const char* text : {"", "a", "hello"}) add_frame(bytes, from_peer(), text);
  proto::FrameParts keyed = from_peer(proto::Kind::group, 42);
  keyed.key = 99;
  add_frame(bytes, keyed, "keyed");
  for (std::size_t step = 1; step <= bytes.size(); ++step) {
    Receiving receiving;
    ASSERT_EQ(receiving.feed(bytes, step), Inbound::Verdict::going);
    ASSERT_EQ(receiving.host.texts(), (std::vector<std::string>{"", "a", "hello", "keyed"}))
        << step;
    EXPECT_EQ(receiving.host.items[3].key, 99u);
    EXPECT_EQ(receiving.host.items[3].to, 42u);
    EXPECT_EQ(receiving.inbound.taken(), 4u);
  }
}

TEST(Inbound, IsNotGivenMessagesOfOthers) {
  Receiving receiving;
  std::vector<std::byte> bytes;
  add_frame(bytes, from_peer(proto::Kind::unicast, kPeerId), "not mine");
  EXPECT_EQ(receiving.feed(bytes), Inbound::Verdict::going);
  EXPECT_TRUE(receiving.host.items.empty());
  EXPECT_EQ(receiving.inbound.counts().ignored, 1u);
  EXPECT_EQ(receiving.inbound.taken(), 1u) << "it counts for resume";
}

TEST(Inbound, IgnoresKindsThatAreNotKnownYet) {
  for (std::uint8_t kind = 8; kind < 16; ++kind) {
    Receiving receiving;
    std::vector<std::byte> bytes;
    add_frame(bytes, from_peer(static_cast<proto::Kind>(kind)), "new");
    EXPECT_EQ(receiving.feed(bytes), Inbound::Verdict::going);
    EXPECT_TRUE(receiving.host.items.empty());
    EXPECT_EQ(receiving.inbound.taken(), 1u);
  }
}

TEST(Inbound, EndsOnWhatAHubMayNotSend) {
  const auto verdict_of = [](const proto::FrameHeader& header, std::string_view payload) {
    Receiving receiving;
    std::vector<std::byte> bytes(proto::kHeaderSize);
    proto::store_header(bytes.data(), header);
    for (const char byte : payload) bytes.push_back(static_cast<std::byte>(byte));
    return receiving.feed(bytes);
  };
  for (unsigned kind = 19; kind < 256; ++kind) {
    proto::FrameHeader header;
    header.kind = static_cast<proto::Kind>(kind);
    EXPECT_EQ(verdict_of(header, ""), Inbound::Verdict::malformed) << kind;
  }
  proto::FrameHeader flow;
  flow.kind = proto::Kind::flow;
  EXPECT_EQ(verdict_of(flow, ""), Inbound::Verdict::malformed);
  proto::FrameHeader names;
  names.kind = proto::Kind::ns;
  EXPECT_EQ(verdict_of(names, ""), Inbound::Verdict::malformed);
}

TEST(Inbound, EndsAtEveryLengthOverTheLargestFrame) {
  for (const std::uint32_t length :
       {65'537u, 1u << 20, 0x7FFF'FFFFu, 0x8000'0000u, 0xFFFF'FFF0u, 0xFFFF'FFFFu}) {
    Receiving receiving;
    std::vector<std::byte> bytes(proto::kHeaderSize);
    proto::FrameHeader header;
    header.length = length;
    proto::store_header(bytes.data(), header);
    EXPECT_EQ(receiving.feed(bytes), Inbound::Verdict::malformed) << length;
    EXPECT_FALSE(receiving.inbound.fault().empty());
  }
}

TEST(Inbound, TakesTheLargestFrame) {
  Receiving receiving;
  std::vector<std::byte> bytes;
  const std::string payload = pattern(65'536);
  for (int i = 0; i < 20; ++i) add_frame(bytes, from_peer(), payload);
  ASSERT_EQ(receiving.feed(bytes, 50'000), Inbound::Verdict::going);
  ASSERT_EQ(receiving.host.texts().size(), 20u);
  EXPECT_EQ(receiving.host.texts().back(), payload);
}

TEST(Inbound, PutsFragmentsTogetherAndTellsOfLoss) {
  Receiving receiving;
  std::vector<std::byte> bytes;
  add_frame(bytes, fragment(1, 0, 6), "abc");
  add_frame(bytes, fragment(1, 3, 6), "def");
  add_frame(bytes, fragment(2, 0, 6), "abc");
  add_frame(bytes, fragment(3, 0, 3), "one");
  add_frame(bytes, fragment(4, 0, 6), "abc");
  add_frame(bytes, from_peer(), "plain");
  ASSERT_EQ(receiving.feed(bytes, 5), Inbound::Verdict::going);
  EXPECT_EQ(receiving.host.texts(), (std::vector<std::string>{"abcdef", "one", "plain"}));
  EXPECT_EQ(receiving.host.gaps(), 2u) << "messages 2 and 4";
  EXPECT_EQ(receiving.inbound.counts().messages_lost, 2u);
}

/// A large message of that operation comes in pieces and in one.
void expect_aligned(char operation, std::size_t before_data) {
  std::string payload(20'000, 'x');
  payload[8] = operation;
  payload[9] = 0;
  payload[10] = 8;  // bytes of extension
  payload[11] = 0;
  for (const std::size_t piece : {std::size_t{3'000}, std::size_t{8'192}, payload.size()}) {
    Receiving receiving;
    std::vector<std::byte> bytes;
    add_frame(bytes, from_peer(), "first");
    for (std::size_t at = 0; at < payload.size(); at += piece) {
      proto::FrameParts parts =
          fragment(1, static_cast<std::uint32_t>(at), static_cast<std::uint32_t>(payload.size()));
      parts.key = 99;
      if (piece == payload.size()) parts.fragment.reset();
      add_frame(bytes, parts, payload.substr(at, piece));
    }
    ASSERT_EQ(receiving.feed(bytes), Inbound::Verdict::going);
    ASSERT_EQ(receiving.host.items.size(), 2u) << piece;
    const auto address = reinterpret_cast<std::uintptr_t>(receiving.host.items[1].payload);
    EXPECT_EQ((address + before_data) % 64, 0u) << int{operation} << ' ' << piece;
    EXPECT_TRUE(receiving.host.texts()[1] == payload) << piece;
    EXPECT_EQ(receiving.host.items[1].key, 99u);
  }
}

TEST(Inbound, AlignsLargeDataBehindTheHeaderOfGimi) {
  constexpr std::size_t kHeader = 12 + 8;
  expect_aligned(0, kHeader);      // DATA
  expect_aligned(2, kHeader + 4);  // REQUEST, which begins with the time that is left
}

TEST(Inbound, CountsMessagesThatWereUnfinishedWhenTheConnectionBroke) {
  Receiving receiving;
  std::vector<std::byte> bytes;
  add_frame(bytes, fragment(1, 0, 6), "abc");
  ASSERT_EQ(receiving.feed(bytes), Inbound::Verdict::going);
  receiving.inbound.begin(Receiving::session());
  ASSERT_EQ(receiving.host.gaps(), 1u);
  EXPECT_EQ(receiving.host.items.back().count, 1u);
  EXPECT_STREQ(receiving.host.items.back().text, "cut_message") << "link_lost counts frames";
}

TEST(Inbound, OpensTheWindowOfALargeMessage) {
  Receiving receiving;
  const std::uint32_t total = 4u << 20;
  const std::string piece = pattern(32 * 1024);
  for (std::uint32_t offset = 0; offset < total;
       offset += static_cast<std::uint32_t>(piece.size())) {
    std::vector<std::byte> bytes;
    add_frame(bytes, fragment(9, offset, total), piece);
    ASSERT_EQ(receiving.feed(bytes), Inbound::Verdict::going);
    if (offset + piece.size() >= proto::kWindowDefault) {
      ASSERT_FALSE(receiving.host.taken_sent.empty());
      EXPECT_GT(receiving.host.taken_sent.back().allowed, offset)
          << "the sender never stands still";
    }
  }
  EXPECT_EQ(receiving.host.taken_sent.back().taken, total);
  ASSERT_EQ(receiving.host.texts().size(), 1u);
  EXPECT_EQ(receiving.host.texts()[0].size(), total);
}

TEST(Inbound, RefusesAMessageThatIsTooLarge) {
  Receiving receiving({.message_bytes_max = 2u << 20, .waiting_bytes_max = 2u << 20});
  std::vector<std::byte> bytes;
  add_frame(bytes, fragment(9, 0, (2u << 20) + 1), "begin");
  ASSERT_EQ(receiving.feed(bytes), Inbound::Verdict::going);
  ASSERT_EQ(receiving.host.taken_sent.size(), 1u);
  EXPECT_TRUE(receiving.host.taken_sent[0].refuses());
  EXPECT_EQ(receiving.host.gaps(), 1u);
}

TEST(Inbound, AnnouncesSkippedFramesAndCountsThem) {
  Receiving receiving;
  std::vector<std::byte> bytes;
  add_flow(bytes, proto::flow::Skip{proto::DropReason::queue_full, 5});
  add_flow(bytes, proto::flow::Skip{proto::DropReason::none, proto::flow::kSkipUnknown});
  ASSERT_EQ(receiving.feed(bytes), Inbound::Verdict::going);
  EXPECT_EQ(receiving.inbound.taken(), 5u);
  ASSERT_EQ(receiving.host.items.size(), 2u);
  EXPECT_EQ(receiving.host.items[0].count, 5u);
  EXPECT_EQ(receiving.host.items[0].reason,
            static_cast<std::uint32_t>(proto::DropReason::queue_full));
  EXPECT_EQ(receiving.host.items[1].count, NIF_COUNT_UNKNOWN);
  std::vector<std::byte> impossible;
  add_flow(impossible, proto::flow::Skip{proto::DropReason::none, UINT64_MAX - 1});
  EXPECT_EQ(receiving.feed(impossible), Inbound::Verdict::malformed);
}

TEST(Inbound, TellsWhatTheHubDroppedAndWhoFilledTheQueue) {
  Receiving receiving;
  std::vector<std::byte> bytes;
  add_flow(bytes, proto::flow::Dropped{proto::DropReason::queue_full, NodeId{7u << 20 | 9}, 5});
  ASSERT_EQ(receiving.feed(bytes), Inbound::Verdict::going);
  EXPECT_EQ(receiving.inbound.taken(), 0u) << "they had no number";
  ASSERT_EQ(receiving.host.items.size(), 1u);
  EXPECT_EQ(receiving.host.items[0].type, std::uint32_t{NIF_GAP});
  EXPECT_EQ(receiving.host.items[0].from, 7u << 20 | 9);
  EXPECT_EQ(receiving.host.items[0].count, 5u);
  EXPECT_EQ(receiving.host.items[0].reason,
            static_cast<std::uint32_t>(proto::DropReason::queue_full));
}

TEST(Inbound, LooksAtNothingBehindGoodbye) {
  Receiving receiving;
  std::vector<std::byte> bytes;
  add_control(bytes, proto::Kind::link,
              proto::encode(proto::Goodbye{proto::GoodbyeCode::kicked, "out"}));
  add_frame(bytes, from_peer(), "late");
  EXPECT_EQ(receiving.feed(bytes), Inbound::Verdict::goodbye);
  EXPECT_EQ(receiving.inbound.goodbye().sentence, "out");
  EXPECT_TRUE(receiving.host.items.empty());
}

TEST(Inbound, ASecondWelcomeIsMalformed) {
  Receiving receiving;
  std::vector<std::byte> bytes;
  add_control(bytes, proto::Kind::link, proto::encode(make_welcome()));
  EXPECT_EQ(receiving.feed(bytes), Inbound::Verdict::malformed);
}

TEST(Inbound, DeliversEventsInOrderWithMessages) {
  Receiving receiving;
  std::vector<std::byte> bytes;
  proto::ns::ServiceMoved moved;
  moved.name = "robot/odom";
  moved.group = GroupId{2};
  moved.provider = NodeId{kPeerId};
  add_control(bytes, proto::Kind::ns, proto::encode(moved));
  add_frame(bytes, from_peer(proto::Kind::group, 2), "first");
  add_control(bytes, proto::Kind::ns, proto::encode(proto::ns::Subscribers{GroupId{3}, 4}));
  ASSERT_EQ(receiving.feed(bytes), Inbound::Verdict::going);
  ASSERT_EQ(receiving.host.items.size(), 3u);
  EXPECT_EQ(receiving.host.items[0].type, static_cast<std::uint32_t>(NIF_SERVICE_MOVED));
  EXPECT_STREQ(receiving.host.items[0].text, "robot/odom");
  EXPECT_EQ(receiving.host.items[0].from, kPeerId);
  EXPECT_EQ(receiving.host.items[1].type, static_cast<std::uint32_t>(NIF_MESSAGE));
  EXPECT_EQ(receiving.host.items[2].type, static_cast<std::uint32_t>(NIF_SUBSCRIBERS));
  EXPECT_EQ(receiving.host.items[2].count, 4u);
}

TEST(Inbound, DeliversNothingOfAnEventThatTheHostKnew) {
  Receiving receiving;
  receiving.host.moved_is_news = false;
  std::vector<std::byte> bytes;
  proto::ns::ServiceMoved moved;
  moved.name = "robot/odom";
  add_control(bytes, proto::Kind::ns, proto::encode(moved));
  ASSERT_EQ(receiving.feed(bytes), Inbound::Verdict::going);
  EXPECT_TRUE(receiving.host.items.empty());
}

TEST(Inbound, ReportsSayWhatBecameOfWhichFrame) {
  Receiving receiving;
  proto::Report report;
  report.reason = proto::DropReason::queue_full;
  report.count = 3;
  report.header.dst = kPeerId;
  report.header.flags = proto::kFlagKeyed;
  const std::string following("\1\0\0\0\0\0\0\0payload!", 16);
  report.following = std::as_bytes(std::span(following));
  std::array<std::byte, proto::kReportSizeMax> payload;
  const std::size_t size = proto::encode_report(report, payload);
  std::vector<std::byte> bytes;
  add_frame(bytes, from_peer(proto::Kind::report),
            {reinterpret_cast<const char*>(payload.data()), size});
  ASSERT_EQ(receiving.feed(bytes), Inbound::Verdict::going);
  ASSERT_EQ(receiving.host.items.size(), 1u);
  EXPECT_EQ(receiving.host.items[0].type, static_cast<std::uint32_t>(NIF_REPORT));
  EXPECT_EQ(receiving.host.items[0].key, 1u);
  EXPECT_EQ(receiving.host.items[0].to, kPeerId);
  EXPECT_EQ(receiving.host.items[0].size, 32u);
  EXPECT_STREQ(receiving.host.items[0].text, "queue_full");
  EXPECT_EQ(receiving.inbound.taken(), 0u) << "reports are not counted for resume";
}

TEST(Inbound, AReportDoesNotCountTheQuestionOfTheLibrary) {
  Receiving receiving;
  proto::Report report;
  report.reason = proto::DropReason::no_such_node;
  report.count = 3;
  report.header.kind = proto::Kind::taken;
  report.header.dst = kPeerId;
  std::array<std::byte, proto::kReportSizeMax> payload;
  const std::size_t size = proto::encode_report(report, payload);
  std::vector<std::byte> bytes;
  add_frame(bytes, from_peer(proto::Kind::report),
            {reinterpret_cast<const char*>(payload.data()), size});
  ASSERT_EQ(receiving.feed(bytes), Inbound::Verdict::going);
  ASSERT_EQ(receiving.host.items.size(), 1u);
  EXPECT_EQ(receiving.host.items[0].count, 2u);
  EXPECT_EQ(receiving.host.items[0].kind, static_cast<std::uint8_t>(proto::Kind::taken));
}

TEST(Inbound, AReportOfAFragmentSaysWhichMessageItWas) {
  Receiving receiving;
  proto::Report report;
  report.reason = proto::DropReason::queue_full;
  report.count = 1;
  report.header.dst = kPeerId;
  report.header.flags = proto::kFlagKeyed | proto::kFlagFragment;
  const std::string following("\1\0\0\0\0\0\0\0\0\0\0\1fore", 16);
  report.following = std::as_bytes(std::span(following));
  std::array<std::byte, proto::kReportSizeMax> payload;
  const std::size_t size = proto::encode_report(report, payload);
  std::vector<std::byte> bytes;
  add_frame(bytes, from_peer(proto::Kind::report),
            {reinterpret_cast<const char*>(payload.data()), size});
  ASSERT_EQ(receiving.feed(bytes), Inbound::Verdict::going);
  ReportedMessages::Start start{};
  start[0] = std::byte{9};
  start[8] = std::byte{'x'};
  receiving.host.start = start;
  ASSERT_EQ(receiving.feed(bytes), Inbound::Verdict::going);
  ASSERT_EQ(receiving.host.items.size(), 2u);
  EXPECT_EQ(receiving.host.items[0].flags, 0u) << "it is not known any more";
  const nif_incoming& known = receiving.host.items[1];
  EXPECT_EQ(known.flags, NIF_FLAG_KEYED);
  EXPECT_EQ(known.key, 9u);
  ASSERT_EQ(known.size, 36u);
  const std::string_view whole = payload_of(known);
  EXPECT_EQ(whole[13], static_cast<char>(proto::kFlagKeyed)) << "as if it had come in one frame";
  EXPECT_EQ(whole[24], 'x');
}

TEST(Inbound, ANewConnectionLosesUnfinishedMessages) {
  Receiving receiving;
  std::vector<std::byte> bytes;
  add_frame(bytes, fragment(9, 0, 2u << 20), "begin");
  ASSERT_EQ(receiving.feed(bytes), Inbound::Verdict::going);
  SessionTerms session = receiving.session();
  receiving.inbound.begin(session);
  EXPECT_EQ(receiving.host.gaps(), 1u);
  ASSERT_EQ(receiving.host.taken_sent.size(), 1u);
  EXPECT_TRUE(receiving.host.taken_sent[0].refuses()) << "the sender need not wait for a window";
  EXPECT_EQ(receiving.inbound.taken(), 0u);
}

TEST(Inbound, AResumedConnectionGoesOn) {
  Receiving receiving;
  std::vector<std::byte> bytes;
  add_frame(bytes, fragment(9, 0, 6), "abc");
  ASSERT_EQ(receiving.feed(bytes), Inbound::Verdict::going);
  SessionTerms session = receiving.session();
  session.resume = session.resumed = true;
  receiving.inbound.begin(session);
  EXPECT_EQ(receiving.inbound.taken(), 1u);
  bytes.clear();
  add_frame(bytes, fragment(9, 3, 6), "def");
  ASSERT_EQ(receiving.feed(bytes), Inbound::Verdict::going);
  EXPECT_EQ(receiving.host.texts(), (std::vector<std::string>{"abcdef"}));
}

TEST(Inbound, ConfirmationIsDueAfterAQuarterOfTheHubsBuffer) {
  Receiving receiving;
  SessionTerms session = receiving.session();
  session.resume = true;
  session.hub_resume_bytes = 400;
  receiving.inbound.begin(session);
  std::vector<std::byte> bytes;
  add_frame(bytes, from_peer(), std::string(83, 'x'));  // 99 bytes
  ASSERT_EQ(receiving.feed(bytes), Inbound::Verdict::going);
  EXPECT_FALSE(receiving.inbound.confirm_due());
  ASSERT_EQ(receiving.feed(bytes), Inbound::Verdict::going);
  EXPECT_TRUE(receiving.inbound.confirm_due());
  receiving.inbound.confirmed();
  EXPECT_FALSE(receiving.inbound.confirm_due());
}

}  // namespace
}  // namespace gimnet::nif::test
