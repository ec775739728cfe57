#include "client/gimi/message_queue.hpp"

#include <gtest/gtest.h>

#include <cstdint>
#include <initializer_list>

#include "client/gimi/inbox.hpp"
#include "client/nif/storage.hpp"
#include "tests/client/gimi/support/made_message.hpp"

namespace gimnet::gimi {
namespace {

using test::make_counted;
using test::make_message;

constexpr std::size_t kBytesMax = 100;

class MessageQueueTest : public testing::Test {
 protected:
  Inbox inbox_{64, kBytesMax, [] {}};
  MessageQueue queue_{inbox_, {{3, AtFullQueue::overwrite_oldest}}, kBytesMax};
};

TEST_F(MessageQueueTest, GivesTheOldestFirst) {
  queue_.push(make_message("a"), 1);
  queue_.push(make_message("b"), 2);
  EXPECT_EQ(queue_.first_arrival(), 1u);
  EXPECT_EQ(queue_.pop()->text(), "a");
  EXPECT_EQ(queue_.pop()->text(), "b");
  EXPECT_FALSE(queue_.pop());
}

TEST_F(MessageQueueTest, OverwritesTheOldestWhenFull) {
  for (std::uint32_t number = 1; number <= 10; ++number)
    queue_.push(make_message("x", number), number);
  EXPECT_EQ(queue_.size(), 3u);
  EXPECT_EQ(queue_.received(), 10u);
  EXPECT_EQ(queue_.overwritten(), 7u);
  EXPECT_EQ(queue_.pop()->sequence(), 8u);
}

TEST_F(MessageQueueTest, OfSizeOneHoldsTheNewest) {
  queue_.resize(1);
  for (std::uint32_t number = 1; number <= 5; ++number)
    queue_.push(make_message("x", number), number);
  EXPECT_EQ(queue_.pop()->sequence(), 5u);
}

TEST_F(MessageQueueTest, HoldsTheNewestUntilItIsDue) {
  queue_.pace(100, 5000);
  EXPECT_EQ(queue_.due_ns(), INT64_MAX) << "nothing is held";
  queue_.hold(make_message("x", 1));
  EXPECT_EQ(queue_.take_due(5000)->sequence(), 1u) << "the first at once";
  queue_.hold(make_counted(7, 1));
  queue_.hold(make_message("x", 3));
  EXPECT_EQ(queue_.left_out(), 1u);
  EXPECT_EQ(queue_.take_taken().size(), 1u);
  EXPECT_EQ(queue_.due_ns(), 5100);
  EXPECT_FALSE(queue_.take_due(5099));
  EXPECT_EQ(queue_.take_due(5130)->sequence(), 3u);
  queue_.hold(make_message("x", 4));
  EXPECT_EQ(queue_.due_ns(), 5200) << "due times keep their distance";
  EXPECT_TRUE(queue_.take_due(9000));
  queue_.hold(make_message("x", 5));
  EXPECT_EQ(queue_.due_ns(), 9100);
  queue_.pace(0, 9010);
  EXPECT_TRUE(queue_.is_paced()) << "until what is held was due";
  EXPECT_TRUE(queue_.take_due(9100));
  EXPECT_FALSE(queue_.is_paced());
}

TEST_F(MessageQueueTest, OneThatIsPacedRefusesNothing) {
  queue_.set({{1, AtFullQueue::stop_reading}});
  queue_.push(make_message("x", 1), 1);
  EXPECT_TRUE(queue_.refuses());
  queue_.pace(100, 5000);
  EXPECT_FALSE(queue_.refuses());
  queue_.hold(make_message("x", 2));
  EXPECT_FALSE(queue_.take_due(5100)) << "there is no room";
  EXPECT_TRUE(queue_.pop());
  EXPECT_TRUE(queue_.take_due(5100));
}

TEST_F(MessageQueueTest, ChangesItsSizeWhileItRuns) {
  for (std::uint32_t number = 1; number <= 3; ++number)
    queue_.push(make_message("x", number), number);
  queue_.resize(2);
  EXPECT_EQ(queue_.overwritten(), 1u);
  queue_.resize(4);
  for (std::uint32_t number = 4; number <= 5; ++number)
    queue_.push(make_message("x", number), number);
  EXPECT_EQ(queue_.size(), 4u);
  EXPECT_EQ(queue_.pop()->sequence(), 2u);
  queue_.resize(1);
  EXPECT_EQ(queue_.size(), 1u);
  queue_.resize(0);
  for (std::uint32_t number = 6; number <= 5 + kQueueMessagesDefault; ++number)
    queue_.push(make_message("x", number), number);
  EXPECT_EQ(queue_.size(), kQueueMessagesDefault) << "0: as many as by default";
}

TEST_F(MessageQueueTest, RefusesAtItsLimitsIfItIsToldTo) {
  queue_.set({{2, AtFullQueue::stop_reading}});
  queue_.push(make_message("a"), 1);
  EXPECT_FALSE(queue_.refuses());
  queue_.push(make_message("b"), 2);
  EXPECT_TRUE(queue_.refuses());
  queue_.set({{10, AtFullQueue::stop_reading}});
  EXPECT_FALSE(queue_.refuses());
  const std::string large(kBytesMax, 'x');
  queue_.push(make_message(large), 3);
  EXPECT_TRUE(queue_.refuses()) << "in bytes, too";
  while (queue_.pop()) continue;
  EXPECT_FALSE(queue_.refuses());
}

TEST_F(MessageQueueTest, GivesTheNewestAndForgetsTheOthers) {
  EXPECT_FALSE(queue_.pop_newest());
  for (std::uint32_t number = 1; number <= 3; ++number)
    queue_.push(make_message("x", number), number);
  EXPECT_EQ(queue_.pop_newest()->sequence(), 3u);
  EXPECT_TRUE(queue_.empty());
}

std::string taken_of(MessageQueue& queue) {
  std::string text;
  for (const TakenMessages& taken : queue.take_taken()) {
    text += std::to_string(taken.group) + "/" + std::to_string(taken.epoch) + "x" +
            std::to_string(taken.count) + " ";
  }
  return text;
}

TEST_F(MessageQueueTest, CountsWhatWentOutOfAWindow) {
  EXPECT_EQ(taken_of(queue_), "");
  for (std::uint64_t arrival = 1; arrival <= 3; ++arrival) queue_.push(make_counted(5, 1), arrival);
  EXPECT_EQ(taken_of(queue_), "") << "it is here, not taken";
  static_cast<void>(queue_.pop());
  EXPECT_EQ(taken_of(queue_), "5/1x1 ");
  EXPECT_EQ(taken_of(queue_), "") << "told once";
  queue_.push(make_counted(5, 1), 4);
  queue_.push(make_counted(5, 1), 5);
  EXPECT_EQ(taken_of(queue_), "5/1x1 ") << "what is overwritten was taken, too";
  static_cast<void>(queue_.pop_newest());
  EXPECT_EQ(taken_of(queue_), "5/1x3 ") << "and what a newer one makes idle";
}

TEST_F(MessageQueueTest, CountsEachGroupAndEpochByItself) {
  queue_.push(make_counted(5, 1), 1);
  queue_.push(make_counted(6, 1), 2);
  queue_.push(make_counted(6, 2), 3);
  while (queue_.pop()) continue;
  EXPECT_EQ(taken_of(queue_), "5/1x1 6/1x1 6/2x1 ");
  queue_.push(make_message("x"), 4);
  queue_.push(make_counted(6, 0), 5);
  queue_.resize(1);
  static_cast<void>(queue_.pop());
  EXPECT_EQ(taken_of(queue_), "") << "without an epoch nothing counts";
}

TEST_F(MessageQueueTest, OneThatGrowsHoldsMoreWhileTheyCostLittle) {
  queue_.set({{3, AtFullQueue::overwrite_oldest}, true});
  queue_.allow(10 * (160 + 1));
  for (std::uint32_t number = 1; number <= 12; ++number)
    queue_.push(make_message("x", number), number);
  EXPECT_EQ(queue_.size(), 10u);
  EXPECT_EQ(queue_.cost_bytes(), 10u * (160 + 1));
  EXPECT_EQ(queue_.overwritten(), 2u);
  queue_.push(make_message("four", 13), 13);
  EXPECT_EQ(queue_.size(), 9u) << "3 bytes more than one of the former ones";
  queue_.allow(5 * (160 + 1) + 3);
  EXPECT_EQ(queue_.size(), 5u);
  queue_.allow(0);
  EXPECT_EQ(queue_.size(), 3u) << "whatever they cost";
  EXPECT_EQ(queue_.pop()->sequence(), 11u);
  queue_.set({{2, AtFullQueue::overwrite_oldest}});
  EXPECT_EQ(queue_.size(), 2u);
}

TEST_F(MessageQueueTest, MessagesOfOneSlabBehindEachOtherShareIt) {
  constexpr std::size_t kPlace = 160;
  nif::Slab* const one = nif::Slab::make();
  nif::Slab* const other = nif::Slab::make();
  auto* const alone = new nif::Record;
  queue_.set({{2, AtFullQueue::overwrite_oldest}, true});
  queue_.allow(SIZE_MAX);
  for (nif::Storage* const storage :
       std::initializer_list<nif::Storage*>{one, one, other, alone, one})
    queue_.push(test::make_stored(10, storage), 1);
  EXPECT_EQ(queue_.cost_bytes(), 5 * (kPlace + 10) + 3 * nif::Slab::kBytes)
      << "one has come back behind others";
  EXPECT_TRUE(queue_.pop());
  EXPECT_EQ(queue_.cost_bytes(), 4 * (kPlace + 10) + 3 * nif::Slab::kBytes);
  EXPECT_EQ(queue_.overwrite_oldest(), 10u);
  EXPECT_EQ(queue_.cost_bytes(), 3 * (kPlace + 10) + 2 * nif::Slab::kBytes);
  EXPECT_TRUE(queue_.pop());
  EXPECT_EQ(queue_.cost_bytes(), 2 * (kPlace + 10) + nif::Slab::kBytes);
  EXPECT_TRUE(queue_.pop_newest());
  EXPECT_EQ(queue_.cost_bytes(), 0u);
  for (nif::Storage* const storage : std::initializer_list<nif::Storage*>{one, other, alone})
    storage->release();
}

TEST_F(MessageQueueTest, OneThatGrowsCountsTheSlabsThatItKeeps) {
  queue_.set({{3, AtFullQueue::overwrite_oldest}, true});
  queue_.allow(5 * (nif::Slab::kBytes + 160));
  for (int i = 0; i < 10; ++i) {
    nif::Slab* const slab = nif::Slab::make();
    queue_.push(test::make_stored(0, slab), 1);
    slab->release();
  }
  EXPECT_EQ(queue_.size(), 5u);
}

}  // namespace
}  // namespace gimnet::gimi
