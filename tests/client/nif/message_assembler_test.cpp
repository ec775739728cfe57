#include "client/nif/message_assembler.hpp"

#include <gtest/gtest.h>

#include <string>
#include <utility>
#include <vector>

#include "client/nif/storage.hpp"

namespace gimnet::nif::test {
namespace {

constexpr std::uint32_t kSender = (7u << 20) | 3;
constexpr std::uint32_t kPiece = 32 * 1024;
constexpr std::uint32_t kLarge = 8u << 20;

proto::FrameView piece(std::uint32_t message, std::uint32_t offset, std::uint32_t total,
                       std::string_view payload, proto::Kind kind = proto::Kind::unicast) {
  proto::FrameView view;
  view.header.src = kSender;
  view.header.kind = kind;
  view.fragment = proto::FragmentHeader{message, offset, total};
  view.payload = std::as_bytes(std::span(payload));
  return view;
}

/// Takes a large message of which a piece comes each so many ns. Returns what was told of it.
std::vector<proto::Taken> take_paced(MessageAssembler& assembler, std::int64_t piece_ns) {
  const std::string payload(kPiece, 'x');
  std::vector<proto::Taken> told;
  std::int64_t now_ns = 0;
  for (std::uint32_t offset = 0; offset < kLarge; offset += kPiece) {
    const auto step = assembler.take(piece(1, offset, kLarge, payload), now_ns += piece_ns);
    if (!step.notice) continue;
    EXPECT_EQ(step.notice->to, kSender);
    told.push_back(step.notice->taken);
  }
  return told;
}

TEST(MessageAssembler, PutsAMessageWhereAnEarlierOneWas) {
  MessageAssembler assembler({});
  std::vector<const void*> places;
  for (const char letter : {'a', 'b'}) {
    const std::string half(kPiece, letter);
    const auto message = static_cast<std::uint32_t>(letter);
    static_cast<void>(assembler.take(piece(message, 0, 2 * kPiece, half), 1));
    auto whole = assembler.take(piece(message, kPiece, 2 * kPiece, half), 2).reassembled;
    ASSERT_EQ(whole.state, proto::Reassembled::State::whole);
    EXPECT_EQ(std::to_integer<char>(whole.message.back()), letter);
    places.push_back(whole.storage.data());
    Record record;
    record.payload = std::move(whole.storage);
    record.spares = assembler.spares();
  }
  EXPECT_EQ(places[0], places[1]);
}

TEST(MessageAssembler, DoesNotWasteThatMemoryOnAMessageInOnePiece) {
  MessageAssembler assembler({});
  ByteBuffer memory;
  ASSERT_TRUE(memory.reserve(2 * kPiece));
  assembler.spares()->give(std::move(memory));
  static_cast<void>(assembler.take(piece(1, 0, kPiece, std::string(kPiece, 'x')), 1));
  EXPECT_EQ(assembler.spares()->bytes(), 2 * kPiece);
}

TEST(MessageAssembler, TheWindowGrowsWhereMessagesComeFast) {
  MessageAssembler assembler({});
  const auto told = take_paced(assembler, 30'000);
  std::uint32_t window = 0;
  for (const proto::Taken& taken : told) window = std::max(window, taken.allowed - taken.taken);
  EXPECT_GE(window, 4 * proto::kWindowDefault);
  EXPECT_LT(told.size(), 16u) << "fewer as the window grows";
}

TEST(MessageAssembler, TheWindowIsNarrowWhereMessagesComeSlowly) {
  MessageAssembler assembler({});
  const auto told = take_paced(assembler, 32'000'000);  // 8 Mbit/s
  for (const proto::Taken& taken : told) {
    EXPECT_LE(taken.allowed - taken.taken, proto::kWindowDefault);
    if (taken.taken < kLarge / 2) continue;
    EXPECT_LE(taken.allowed - taken.taken, 400u * 1024) << taken.taken;
    EXPECT_TRUE(taken.allowed == kLarge || taken.allowed - taken.taken >= kPiece)
        << "the next piece may come";
  }
  EXPECT_EQ(told.back().taken, kLarge);
}

TEST(MessageAssembler, TheSenderOfAMessageIsNeverLeftWaiting) {
  for (const std::int64_t piece_ns : {0, 1'000, 1'000'000, 100'000'000, 2'000'000'000}) {
    MessageAssembler assembler({});
    const std::string payload(kPiece, 'x');
    std::uint32_t allowed = proto::kWindowDefault;
    std::int64_t now_ns = 0;
    for (std::uint32_t offset = 0; offset < kLarge; offset += kPiece) {
      ASSERT_GE(allowed, offset + kPiece) << piece_ns;
      const auto step = assembler.take(piece(1, offset, kLarge, payload), now_ns += piece_ns);
      if (step.notice) allowed = std::max(allowed, step.notice->taken.allowed);
    }
  }
}

TEST(MessageAssembler, SmallMessagesAndOtherKindsNeedNoWindow) {
  MessageAssembler assembler({});
  EXPECT_FALSE(assembler.take(piece(1, 0, 6, "abcdef"), 1).notice);
  EXPECT_FALSE(assembler.take(piece(2, 0, proto::kWindowDefault, "abc"), 1).notice);
  EXPECT_FALSE(assembler.take(piece(3, 0, kLarge, "abc", proto::Kind::group), 1).notice);
}

TEST(MessageAssembler, TellsTheSenderThatAMessageIsLost) {
  MessageAssembler assembler({});
  static_cast<void>(assembler.take(piece(1, 0, kLarge, "abc"), 1));
  const auto step = assembler.take(piece(1, 5, kLarge, "gap"), 1);
  EXPECT_EQ(step.reassembled.lost_messages, 1u);
  ASSERT_TRUE(step.notice);
  EXPECT_TRUE(step.notice->taken.refuses());
}

TEST(MessageAssembler, SaysAgainWhatSendersAreToKnow) {
  MessageAssembler assembler({});
  static_cast<void>(assembler.take(piece(1, 0, kLarge, "abc"), 1));
  static_cast<void>(assembler.take(piece(1, 5, kLarge, "gap"), 1));
  static_cast<void>(assembler.take(piece(2, 0, kLarge, "abcd"), 1));
  const auto notices = assembler.notices_again(NodeId{kSender});
  ASSERT_EQ(notices.size(), 2u);
  EXPECT_EQ(notices[0].taken, proto::ReceiveWindow::refusal(1));
  EXPECT_EQ(notices[1].taken.message, 2u);
  EXPECT_EQ(notices[1].taken.taken, 4u);
  EXPECT_GT(notices[1].taken.allowed, 4u);
  EXPECT_TRUE(assembler.notices_again(NodeId{kSender + 1}).empty());
  EXPECT_EQ(assembler.notices_again(std::nullopt).size(), 2u);
}

TEST(MessageAssembler, ClearingTellsTheSendersOfLargeMessages) {
  MessageAssembler assembler({});
  static_cast<void>(assembler.take(piece(4, 0, kLarge, "abc"), 1));
  static_cast<void>(assembler.take(piece(5, 0, 10, "abc", proto::Kind::service), 1));
  const auto lost = assembler.clear();
  EXPECT_EQ(lost.messages, 2u);
  ASSERT_EQ(lost.notices.size(), 1u);
  EXPECT_EQ(lost.notices[0].to, kSender);
  EXPECT_EQ(lost.notices[0].taken.message, 4u);
}

TEST(MessageAssembler, WindowsOfHostileSendersAreBounded) {
  MessageAssembler assembler(
      {.message_bytes_max = 64u << 20, .waiting_bytes_max = 64u << 20, .streams_max = 8});
  for (std::uint32_t message = 1; message < 1000; ++message) {
    static_cast<void>(assembler.take(piece(message, 0, kLarge, "x"), 1));
  }
  EXPECT_LE(assembler.clear().notices.size(), 8u);
}

TEST(MessageAssembler, MessagesThatEndCostOthersNoWindow) {
  MessageAssembler assembler(
      {.message_bytes_max = 64u << 20, .waiting_bytes_max = 64u << 20, .streams_max = 8});
  const std::string quarter(proto::kWindowDefault / 4, 'x');
  EXPECT_TRUE(assembler.take(piece(1, 0, kLarge, quarter), 1).notice);
  for (std::uint32_t message = 1; message < 1000; ++message) {
    auto beginning = piece(message, 0, kLarge, "x");
    beginning.header.src = kSender + 1;
    static_cast<void>(assembler.take(beginning, 1));
  }
  const auto offset = static_cast<std::uint32_t>(quarter.size());
  EXPECT_FALSE(assembler.take(piece(1, offset, kLarge, "x"), 1).notice) << "it was told just now";
}

}  // namespace
}  // namespace gimnet::nif::test
