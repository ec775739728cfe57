#include "client/nif/message_assembler.hpp"

#include <gtest/gtest.h>

#include <string>

namespace gimnet::nif::test {
namespace {

constexpr std::uint32_t kSender = (7u << 20) | 3;
constexpr std::uint32_t kPiece = 32 * 1024;
constexpr std::uint32_t kLarge = 8u << 20;

proto::FrameView piece(std::uint32_t message, std::uint32_t offset, std::uint32_t total, std::string_view payload,
                       proto::Kind kind = proto::Kind::unicast) {
  proto::FrameView view;
  view.header.src = kSender;
  view.header.kind = kind;
  view.fragment = proto::FragmentHeader{message, offset, total};
  view.payload = std::as_bytes(std::span(payload));
  return view;
}

TEST(MessageAssembler, TheWindowGrowsWhileAMessageComesWhole) {
  MessageAssembler assembler({});
  const std::string payload(kPiece, 'x');
  std::uint32_t notices = 0;
  std::uint32_t window = 0;
  for (std::uint32_t offset = 0; offset < kLarge; offset += kPiece) {
    const auto step = assembler.take(piece(1, offset, kLarge, payload));
    if (!step.notice) continue;
    ++notices;
    EXPECT_EQ(step.notice->to, kSender);
    window = std::max(window, step.notice->taken.allowed - step.notice->taken.taken);
  }
  EXPECT_GT(window, proto::kWindowDefault);
  EXPECT_LT(notices, 16u) << "fewer as the window grows";
}

TEST(MessageAssembler, SmallMessagesAndOtherKindsNeedNoWindow) {
  MessageAssembler assembler({});
  EXPECT_FALSE(assembler.take(piece(1, 0, 6, "abcdef")).notice);
  EXPECT_FALSE(assembler.take(piece(2, 0, proto::kWindowDefault, "abc")).notice);
  EXPECT_FALSE(assembler.take(piece(3, 0, kLarge, "abc", proto::Kind::group)).notice);
}

TEST(MessageAssembler, TellsTheSenderThatAMessageIsLost) {
  MessageAssembler assembler({});
  static_cast<void>(assembler.take(piece(1, 0, kLarge, "abc")));
  const auto step = assembler.take(piece(1, 5, kLarge, "gap"));
  EXPECT_EQ(step.reassembled.lost_messages, 1u);
  ASSERT_TRUE(step.notice);
  EXPECT_TRUE(step.notice->taken.refuses());
}

TEST(MessageAssembler, ClearingTellsTheSendersOfLargeMessages) {
  MessageAssembler assembler({});
  static_cast<void>(assembler.take(piece(4, 0, kLarge, "abc")));
  static_cast<void>(assembler.take(piece(5, 0, 10, "abc", proto::Kind::service)));
  const auto lost = assembler.clear();
  EXPECT_EQ(lost.messages, 2u);
  ASSERT_EQ(lost.notices.size(), 1u);
  EXPECT_EQ(lost.notices[0].to, kSender);
  EXPECT_EQ(lost.notices[0].taken.message, 4u);
}

TEST(MessageAssembler, WindowsOfHostileSendersAreBounded) {
  MessageAssembler assembler({.message_bytes_max = 64u << 20, .waiting_bytes_max = 64u << 20, .streams_max = 8});
  for (std::uint32_t message = 1; message < 1000; ++message) {
    static_cast<void>(assembler.take(piece(message, 0, kLarge, "x")));
  }
  EXPECT_LE(assembler.clear().notices.size(), 8u);
}

}  // namespace
}  // namespace gimnet::nif::test
