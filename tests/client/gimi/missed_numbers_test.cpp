#include "client/gimi/missed_numbers.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <cstdint>
#include <memory>
#include <random>
#include <set>
#include <utility>
#include <vector>

#include "client/gimi/services.hpp"
#include "tests/client/gimi/support/made_message.hpp"

namespace gimnet::gimi {
namespace {

MissedNumbers standing_at(std::uint32_t number) {
  MissedNumbers numbers;
  numbers.begin(number);
  return numbers;
}

TEST(MissedNumbers, CountsWhatIsLeftOut) {
  MissedNumbers numbers = standing_at(7);
  EXPECT_FALSE(numbers.take(8));
  EXPECT_TRUE(numbers.take(11));
  EXPECT_EQ(numbers.count(), 2u);
  EXPECT_EQ(numbers.highest(), 11u);
}

TEST(MissedNumbers, TakesOffWhatComesLate) {
  MissedNumbers numbers = standing_at(1);
  EXPECT_TRUE(numbers.take(4));
  EXPECT_TRUE(numbers.take(2));
  EXPECT_FALSE(numbers.take(2)) << "it came before";
  EXPECT_FALSE(numbers.take(4));
  EXPECT_EQ(numbers.count(), 1u);
  EXPECT_FALSE(numbers.take(5)) << "it stands at 4, and not at 2";
  EXPECT_TRUE(numbers.take(3));
  EXPECT_EQ(numbers.count(), 0u);
}

TEST(MissedNumbers, WhatWasBeforeTheFirstOneIsNotTakenOff) {
  MissedNumbers numbers = standing_at(10);
  EXPECT_FALSE(numbers.take(9));
  EXPECT_FALSE(numbers.take(10));
  EXPECT_EQ(numbers.count(), 0u);
}

TEST(MissedNumbers, KnowTheLast64) {
  MissedNumbers numbers = standing_at(0);
  EXPECT_TRUE(numbers.take(MissedNumbers::kWindow + 1));
  EXPECT_EQ(numbers.count(), MissedNumbers::kWindow);
  EXPECT_FALSE(numbers.take(1)) << "65 numbers of which it is the first";
  EXPECT_TRUE(numbers.take(2));
  EXPECT_EQ(numbers.count(), MissedNumbers::kWindow - 1);
}

TEST(MissedNumbers, GoOnAcrossTheLastNumber) {
  MissedNumbers numbers = standing_at(UINT32_MAX - 1);
  EXPECT_TRUE(numbers.take(2));
  EXPECT_EQ(numbers.count(), 3u);
  EXPECT_TRUE(numbers.take(UINT32_MAX));
  EXPECT_TRUE(numbers.take(0));
  EXPECT_EQ(numbers.count(), 1u);
}

TEST(MissedNumbers, CountOneThatWillNotComeOnce) {
  MissedNumbers numbers = standing_at(5);
  EXPECT_TRUE(numbers.miss(7));
  EXPECT_EQ(numbers.count(), 2u) << "6, and 7 itself";
  EXPECT_FALSE(numbers.miss(7));
  EXPECT_FALSE(numbers.miss(6));
  EXPECT_FALSE(numbers.take(8));
  EXPECT_TRUE(numbers.take(6));
  EXPECT_EQ(numbers.count(), 1u);
}

/// The count that one subscriber has to have: numbers that were left out since it began, unless
/// they came while they were among the last ones.
class Truth {
 public:
  void begin(std::uint64_t number) {
    before_ += missing_.size();
    missing_.clear();
    highest_ = number;
  }
  void take(std::uint64_t number) {
    for (; highest_ < number; ++highest_) missing_.insert(highest_ + 1);
    if (highest_ - number < MissedNumbers::kWindow) missing_.erase(number);
  }
  [[nodiscard]] std::uint64_t count() const { return before_ + missing_.size(); }
  [[nodiscard]] std::uint64_t highest() const { return highest_; }

 private:
  std::uint64_t highest_ = 0;
  std::uint64_t before_ = 0;  ///< of former streams
  std::set<std::uint64_t> missing_;
};

/// A provider, a network that drops, delays and repeats, and subscriptions that begin and end.
class World {
 public:
  explicit World(std::uint32_t seed) : random_(seed), number_(draw(2) == 0 ? 0 : kNearEnd) {}

  void step() {
    if (draw(200) == 0) begin_stream();
    if (draw(40) == 0 && readers_.size() < 3) subscribe();
    if (draw(60) == 0 && !readers_.empty()) unsubscribe();
    publish();
    for (auto each = on_the_way_.begin(); each != on_the_way_.end();) {
      if (draw(each->slow ? 30 : 1) != 0) {
        ++each;
        continue;
      }
      deliver(each->number);
      each = on_the_way_.erase(each);
    }
    if (draw(25) == 0 && newest_) deliver(*newest_);  // as a retained one, given again
  }
  void expect_the_truth() {
    for (auto& [subscriber, truth] : readers_)
      ASSERT_EQ(service_.missed(*subscriber), truth.count()) << "at " << number_;
  }

 private:
  struct Sent {
    std::uint64_t number;
    bool slow;
  };
  static constexpr std::uint64_t kNearEnd = UINT32_MAX - 500ull;

  std::uint32_t draw(std::uint32_t below) {
    return std::uniform_int_distribution<std::uint32_t>(0, below - 1)(random_);
  }
  void begin_stream() {
    ++epoch_;
    number_ = 0;
    on_the_way_.clear();
    newest_.reset();
  }
  void subscribe() {
    readers_.emplace_back(service_.add({.queue = 1}), Truth{});
    if (readers_.size() == 1) {
      newest_.reset();
    } else if (newest_) {
      readers_.back().second.begin(readers_.front().second.highest());
    }
  }
  void unsubscribe() {
    const auto goes = readers_.begin() + draw(static_cast<std::uint32_t>(readers_.size()));
    service_.remove(*goes->first);
    readers_.erase(goes);
  }
  void publish() {
    ++number_;
    if (draw(10) != 0) on_the_way_.push_back({number_, draw(8) == 0});
  }
  void deliver(std::uint64_t number) {
    const auto sequence = static_cast<std::uint32_t>(number);
    const SubscribedService::Position position{Peer{kProvider}, {}, epoch_, sequence};
    Message message = test::make_message("x", sequence);
    static_cast<void>(service_.put(position, message));
    if (readers_.empty()) return;
    for (auto& [subscriber, truth] : readers_) {
      if (newest_) {
        truth.take(number);
      } else {
        truth.begin(number);
      }
    }
    newest_ = std::max(newest_.value_or(number), number);
  }

  static constexpr std::uint32_t kProvider = (7u << 20) | 5;
  std::mt19937 random_;
  Inbox inbox_{64, 1000, [] {}};
  SubscribedService service_{"robot/eye", inbox_};
  std::vector<std::pair<SubscribedService::SharedSubscriber, Truth>> readers_;
  std::uint32_t epoch_ = 1;
  std::uint64_t number_;
  std::vector<Sent> on_the_way_;
  std::optional<std::uint64_t> newest_;  ///< that came of this stream since somebody reads it
};

TEST(SubscribedServiceModel, MissedIsTheTruthWhileMessagesComeLateAndTwice) {
  for (std::uint32_t seed = 1; seed <= 200; ++seed) {
    SCOPED_TRACE("seed " + std::to_string(seed));
    World world(seed);
    for (int i = 0; i < 1000 && !testing::Test::HasFatalFailure(); ++i) {
      world.step();
      world.expect_the_truth();
    }
    if (testing::Test::HasFatalFailure()) return;
  }
}

}  // namespace
}  // namespace gimnet::gimi
