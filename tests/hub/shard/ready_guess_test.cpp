#include "hub/shard/ready_guess.hpp"

#include <gtest/gtest.h>

#include <array>
#include <cstdint>

namespace gimnet::hub {
namespace {

constexpr std::array<Ready, 2> kTwo{Ready{1, true, false}, Ready{2, true, false}};
constexpr std::span<const Ready> kOne(kTwo.data(), 1);
constexpr std::uint64_t kSmall = 100;
/// More than it takes for the first guess.
constexpr int kTurns = 20;
constexpr std::int64_t kTurnNs = 6'000;

class ReadyGuessTest : public ::testing::Test {
 protected:
  /// Behind a turn of `took_ns`. What is not guessed is waited for, and comes at once.
  bool guesses(std::span<const Ready> ready, std::uint64_t received, bool has_rest = false,
               std::int64_t took_ns = kTurnNs) {
    now_ns_ += took_ns;
    const bool guessed = guess_.same_again(ready, received, has_rest, [this] { return now_ns_; });
    if (!guessed) guess_.woke(now_ns_);
    return guessed;
  }
  /// Turns of one who always has something, up to the first guess.
  void expect_first_guess() {
    for (int turn = 0; turn < kTurns; ++turn) {
      if (guesses(kOne, kSmall)) return;
    }
    FAIL() << "no guess";
  }
  bool ever_guesses(std::span<const Ready> ready, std::uint64_t received, bool has_rest = false,
                    std::int64_t took_ns = kTurnNs) {
    for (int turn = 0; turn < kTurns; ++turn) {
      if (guesses(ready, received, has_rest, took_ns)) return true;
    }
    return false;
  }
  ReadyGuess guess_;
  std::int64_t now_ns_ = 1'000'000;
};

TEST_F(ReadyGuessTest, OneWhoWritesSmallMessagesIsReadAgain) { expect_first_guess(); }

TEST_F(ReadyGuessTest, OthersAreLookedForWhenItsTimeIsUp) {
  expect_first_guess();
  for (int round = 0; round < 3; ++round) {
    int turns = 1;  // that of the first guess, or of the wait
    while (guesses(kOne, kSmall)) ++turns;
    EXPECT_LT((turns - 1) * kTurnNs, ReadyGuess::kBusyNsMax);
    EXPECT_GE((turns + 1) * kTurnNs, ReadyGuess::kBusyNsMax);
  }
}

TEST_F(ReadyGuessTest, ATurnThatTookLongIsNotRepeated) {
  EXPECT_FALSE(ever_guesses(kOne, kSmall, false, ReadyGuess::kBusyNsMax));
  EXPECT_TRUE(ever_guesses(kOne, kSmall, false, ReadyGuess::kBusyNsMax - 1));
}

TEST_F(ReadyGuessTest, WhoHasSomethingLeftToDoLooksForOthersFirst) {
  EXPECT_FALSE(ever_guesses(kOne, kSmall, true));
  expect_first_guess();
  EXPECT_FALSE(guesses(kOne, kSmall, true));
  EXPECT_TRUE(guesses(kOne, kSmall)) << "that was no wrong guess";
}

TEST_F(ReadyGuessTest, AWrongGuessIsFollowedByAWait) {
  expect_first_guess();
  EXPECT_FALSE(guesses(kOne, 0));
}

TEST_F(ReadyGuessTest, WrongGuessesBecomeRare) {
  int wrong = 0;
  std::uint64_t received = kSmall;
  constexpr int kManyTurns = 6'500;
  for (int turn = 0; turn < kManyTurns; ++turn) {
    const bool guessed = guesses(kOne, received);
    wrong += guessed ? 1 : 0;
    received = guessed ? 0 : kSmall;
  }
  EXPECT_GE(wrong, kManyTurns / 65) << "it goes on trying";
  EXPECT_LE(wrong, kManyTurns / 65 + 10);
}

TEST_F(ReadyGuessTest, NobodyIsPreferredBeforeAnother) { EXPECT_FALSE(ever_guesses(kTwo, kSmall)); }

TEST_F(ReadyGuessTest, NothingIsGuessedAfterAWaitInWhichNobodyWasReady) {
  EXPECT_FALSE(ever_guesses({}, 0));
}

TEST_F(ReadyGuessTest, LargeReadsAreWorthAWait) {
  EXPECT_FALSE(ever_guesses(kOne, ReadyGuess::kReceivedMax + 1));
  EXPECT_TRUE(ever_guesses(kOne, ReadyGuess::kReceivedMax));
}

TEST_F(ReadyGuessTest, ATurnThatReadNothingIsNotRepeated) { EXPECT_FALSE(ever_guesses(kOne, 0)); }

TEST_F(ReadyGuessTest, AWakerOrAWritableOneIsNotTakenForReadyAgain) {
  const Ready waker{Poller::kOwnToken, true, false};
  EXPECT_FALSE(ever_guesses({&waker, 1}, kSmall));
  const Ready writable{1, true, true};
  EXPECT_FALSE(ever_guesses({&writable, 1}, kSmall));
}

}  // namespace
}  // namespace gimnet::hub
