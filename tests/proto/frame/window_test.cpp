#include "proto/frame/window.hpp"

#include <gtest/gtest.h>

#include <optional>

namespace gimnet::proto {
namespace {

using Progress = SendWindow::Progress;

constexpr std::uint32_t kTotal = 10 * kWindowDefault;

std::uint32_t under_way(const SendWindow& window) { return window.sent() - window.taken(); }

/// The word to the sender when so many were received.
std::optional<Taken> told(ReceiveWindow& window, std::uint32_t received) {
  if (!window.due(received)) return std::nullopt;
  return window.tell(received);
}

TEST(SendWindow, SendsAMebibyteUnasked) {
  SendWindow window(9, kTotal);
  EXPECT_EQ(window.room(), kWindowDefault);
  window.on_sent(kWindowDefault);
  EXPECT_EQ(window.room(), 0u);
  EXPECT_EQ(under_way(window), kWindowDefault);
}

TEST(SendWindow, SendsASmallerMessageAtOnce) {
  SendWindow window(9, 100);
  EXPECT_EQ(window.room(), 100u);
  window.on_sent(100);
  EXPECT_EQ(window.on_taken({9, 100, 100}), Progress::finished);
}

TEST(SendWindow, OpensByWhatIsAllowed) {
  SendWindow window(9, kTotal);
  window.on_sent(kWindowDefault);
  EXPECT_EQ(window.on_taken({9, 1000, kWindowDefault + 1000}), Progress::going);
  EXPECT_EQ(window.room(), 1000u);
  EXPECT_EQ(under_way(window), kWindowDefault - 1000);
}

TEST(SendWindow, IsNotMovedBackByAnOldTaken) {
  SendWindow window(9, kTotal);
  window.on_sent(2000);
  EXPECT_EQ(window.on_taken({9, 2000, kWindowDefault + 2000}), Progress::going);
  EXPECT_EQ(window.on_taken({9, 1000, kWindowDefault + 1000}), Progress::going);
  EXPECT_EQ(window.taken(), 2000u);
  EXPECT_EQ(window.room(), kWindowDefault);
}

TEST(SendWindow, IgnoresWhatCannotBe) {
  SendWindow window(9, kTotal);
  window.on_sent(1000);
  EXPECT_EQ(window.on_taken({8, 1000, 5000}), Progress::ignored);
  EXPECT_EQ(window.on_taken({9, 1001, UINT32_MAX}), Progress::ignored);
  EXPECT_EQ(window.room(), kWindowDefault - 1000);
  EXPECT_EQ(window.on_taken({9, 1000, UINT32_MAX}), Progress::going);
  EXPECT_EQ(window.room(), kTotal - 1000) << "never over the total";
}

TEST(SendWindow, GivesUpWhenRefused) {
  SendWindow window(9, kTotal);
  window.on_sent(1000);
  EXPECT_EQ(window.on_taken(ReceiveWindow::refusal(9)), Progress::refused);
}

TEST(ReceiveWindow, TellsAfterEachQuarterAndAtTheEnd) {
  ReceiveWindow window(9, 1000, 400);
  EXPECT_EQ(told(window, 99), std::nullopt);
  EXPECT_EQ(told(window, 100), (Taken{9, 100, 500}));
  EXPECT_EQ(told(window, 199), std::nullopt);
  EXPECT_EQ(told(window, 700), (Taken{9, 700, 1000}));
  EXPECT_EQ(told(window, 1000), (Taken{9, 1000, 1000}));
}

TEST(ReceiveWindow, NeverTakesBackWhatItAllowed) {
  ReceiveWindow window(9, 10'000, 4000);
  EXPECT_EQ(told(window, 1000), (Taken{9, 1000, 5000}));
  window.set_window(100);
  EXPECT_EQ(told(window, 1025), (Taken{9, 1025, 5000}));
  EXPECT_EQ(told(window, 5000), (Taken{9, 5000, 5100}));
}

TEST(ReceiveWindow, MayChangeBetweenDueAndTell) {
  ReceiveWindow window(9, 10'000, 400);
  EXPECT_FALSE(window.due(99));
  ASSERT_TRUE(window.due(100));
  window.set_window(4000);
  EXPECT_EQ(window.tell(100), (Taken{9, 100, 4100}))
      << "although a quarter of the new one did not come";
  EXPECT_FALSE(window.due(1099));
  EXPECT_TRUE(window.due(1100));
}

TEST(Windows, BringAGibibyteThrough) {
  SendWindow sender(9, kMessageBytesMax);
  ReceiveWindow receiver(9, kMessageBytesMax);
  Fragmenter fragmenter(kMessageBytesMax);
  std::uint32_t received = 0;
  auto progress = Progress::going;
  while (progress == Progress::going) {
    std::optional<Taken> taken;
    while (sender.room() > 0) {
      const Piece piece = fragmenter.next(sender.room());
      sender.on_sent(piece.size);
      ASSERT_LE(under_way(sender), kWindowDefault);
      received += piece.size;
      if (const auto due = told(receiver, received)) taken = due;
    }
    ASSERT_TRUE(taken) << "stands still at " << received;
    progress = sender.on_taken(*taken);
  }
  EXPECT_EQ(progress, Progress::finished);
  EXPECT_EQ(received, kMessageBytesMax);
}

}  // namespace
}  // namespace gimnet::proto
