#include "client/gimi/wait_set.hpp"

#include <gtest/gtest.h>
#include <poll.h>

#include <algorithm>
#include <array>
#include <atomic>
#include <deque>
#include <memory>
#include <thread>
#include <vector>

#include "base/clock.hpp"
#include "client/gimi/answer_queue.hpp"
#include "client/gimi/inbox.hpp"
#include "client/gimi/watch_queues.hpp"
#include "tests/client/gimi/support/made_message.hpp"

namespace gimnet::gimi {
namespace {

constexpr Timeout kPatience{20'000};

using Set = std::shared_ptr<WaitSet>;

/// Things that wait, as in the queues of a node.
class Heap {
 public:
  bool join(const Set& set, std::uint64_t user) {
    const MutexLock lock(mutex_);
    return source_.join(set, {this, 0, user}, things_ != 0);
  }
  void leave() {
    const MutexLock lock(mutex_);
    source_.leave();
  }
  void put() {
    const MutexLock lock(mutex_);
    ++things_;
    source_.update(true);
  }
  bool take() {
    const MutexLock lock(mutex_);
    if (things_ == 0) return false;
    source_.update(--things_ != 0);
    return true;
  }

 private:
  Mutex mutex_;
  int things_ = 0;
  WaitSource source_;
};

std::vector<std::uint64_t> ready(const Set& set, std::size_t most = 64, Timeout timeout = kNoWait) {
  std::array<gimi_ready, 64> members{};
  const auto count = set->wait(std::span(members).first(most), timeout);
  std::vector<std::uint64_t> users;
  if (!count) return users;
  for (const gimi_ready& member : std::span(members).first(*count)) users.push_back(member.user);
  return users;
}

bool is_readable(int descriptor) {
  pollfd polled{descriptor, POLLIN, 0};
  return ::poll(&polled, 1, 0) == 1;
}

using Users = std::vector<std::uint64_t>;

class WaitSetTest : public testing::Test {
 protected:
  const Set set_ = std::make_shared<WaitSet>();
};

TEST_F(WaitSetTest, TellsAMemberUntilEverythingWasTaken) {
  Heap heap;
  heap.put();
  EXPECT_TRUE(heap.join(set_, 7));
  heap.put();
  EXPECT_EQ(ready(set_), Users{7});
  EXPECT_TRUE(heap.take());
  EXPECT_EQ(ready(set_), Users{7});
  EXPECT_TRUE(heap.take());
  EXPECT_EQ(ready(set_), Users{});
  heap.put();
  EXPECT_EQ(ready(set_), Users{7});
}

TEST_F(WaitSetTest, AMemberThatWasToldGoesToTheEnd) {
  std::array<Heap, 3> heaps;
  for (std::size_t i = 0; i < heaps.size(); ++i) {
    EXPECT_TRUE(heaps[i].join(set_, i));
    heaps[i].put();
  }
  EXPECT_EQ(ready(set_, 2), (Users{0, 1}));
  EXPECT_EQ(ready(set_, 2), (Users{2, 0}));
  EXPECT_EQ(ready(set_, 64), (Users{1, 2, 0})) << "each once";
}

TEST_F(WaitSetTest, ASourceIsInOneSet) {
  Heap heap;
  const Set other = std::make_shared<WaitSet>();
  heap.put();
  EXPECT_TRUE(heap.join(set_, 1));
  EXPECT_FALSE(heap.join(other, 2));
  EXPECT_FALSE(heap.join(set_, 2));
  heap.leave();
  EXPECT_EQ(ready(set_), Users{});
  EXPECT_TRUE(heap.join(other, 2));
  EXPECT_EQ(ready(other), Users{2});
  other->end();
  EXPECT_TRUE(heap.join(set_, 3)) << "its set has ended";
  EXPECT_EQ(ready(set_), Users{3});
}

TEST_F(WaitSetTest, ASourceThatEndsIsInNone) {
  auto heap = std::make_unique<Heap>();
  EXPECT_TRUE(heap->join(set_, 1));
  heap->put();
  heap.reset();
  EXPECT_EQ(ready(set_), Users{});
}

TEST_F(WaitSetTest, SaysWhyItHasNothing) {
  std::array<gimi_ready, 1> member{};
  EXPECT_TRUE(set_->wait(member, Timeout{1}).is(Status::timeout));
  set_->wake();
  EXPECT_EQ(*set_->wait(member, kForever), 0u);
  EXPECT_TRUE(set_->wait(member, kNoWait).is(Status::timeout)) << "one wait ended";
  std::thread waiter([&] { EXPECT_TRUE(set_->wait(member, kPatience).is(Status::closed)); });
  set_->end();
  waiter.join();
  EXPECT_TRUE(set_->descriptor().is(Status::closed));
}

TEST_F(WaitSetTest, ItsDescriptorIsReadableWhileAMemberHasSomething) {
  Heap heap;
  EXPECT_TRUE(heap.join(set_, 1));
  heap.put();
  const int descriptor = set_->descriptor().or_throw();
  EXPECT_TRUE(is_readable(descriptor)) << "what was there before it";
  EXPECT_EQ(ready(set_), Users{1});
  EXPECT_TRUE(is_readable(descriptor));
  EXPECT_TRUE(heap.take());
  EXPECT_FALSE(is_readable(descriptor));
  heap.put();
  EXPECT_TRUE(is_readable(descriptor));
  heap.leave();
  EXPECT_FALSE(is_readable(descriptor));
  set_->wake();
  EXPECT_TRUE(is_readable(descriptor));
  EXPECT_EQ(ready(set_), Users{});
  EXPECT_FALSE(is_readable(descriptor));
  EXPECT_EQ(set_->descriptor().or_throw(), descriptor);
}

/// The least time of several, so that what else the machine does counts for nothing.
std::int64_t cost_ns(const Set& set, Heap& heap) {
  std::int64_t least = INT64_MAX;
  for (int round = 0; round < 5; ++round) {
    const std::int64_t begin = steady_now_ns();
    for (int i = 0; i < 100; ++i) {
      heap.put();
      EXPECT_EQ(ready(set).size(), 1u);
      EXPECT_TRUE(heap.take());
    }
    least = std::min(least, steady_now_ns() - begin);
  }
  return least;
}

// A look at each of 10,000 would take a hundred times as long as the whole.
TEST_F(WaitSetTest, CostsTheSameBesideTenThousandMembers) {
  Heap heap;
  EXPECT_TRUE(heap.join(set_, 0));
  const std::int64_t alone = cost_ns(set_, heap);
  std::deque<Heap> others(10'000);
  for (Heap& other : others) ASSERT_TRUE(other.join(set_, 1));
  EXPECT_LT(cost_ns(set_, heap), 10 * alone);
}

// One thread that takes its time for what it was told does not keep it from the others.
TEST_F(WaitSetTest, TellsEveryThreadThatWaits) {
  Heap heap;
  EXPECT_TRUE(heap.join(set_, 1));
  for (int round = 0; round < 5; ++round) {
    std::atomic<int> begun = 0;
    std::atomic<int> told = 0;
    std::vector<std::thread> threads;
    for (int i = 0; i < 3; ++i) {
      threads.emplace_back([&] {
        ++begun;
        told += static_cast<int>(ready(set_, 1, kPatience).size());
      });
    }
    // Most wait by then, in most rounds.
    for (int yields = 0; begun < 3 || yields < 10; ++yields) std::this_thread::yield();
    heap.put();
    const std::int64_t begin = steady_now_ns();
    for (std::thread& thread : threads) thread.join();
    ASSERT_EQ(told, 3);
    ASSERT_LT(steady_now_ns() - begin, 10'000'000'000) << "not told, but looked at the end";
    EXPECT_TRUE(heap.take());
  }
}

// It can be proved that each thing is taken once, whoever joins, leaves and ends meanwhile; a
// thread that waits always finds what is left.
TEST_F(WaitSetTest, NoWakeUpIsLostBetweenThreads) {
  constexpr int kHeaps = 8;
  constexpr int kThings = 20'000;
  std::array<Heap, kHeaps> heaps;
  for (std::size_t i = 0; i < kHeaps; ++i) ASSERT_TRUE(heaps[i].join(set_, i));
  std::atomic<int> left = kThings;
  std::vector<std::thread> threads;
  for (std::size_t first = 0; first < 2; ++first) {
    threads.emplace_back([&heaps, first] {
      for (std::size_t i = first; i < kThings; i += 2) heaps[i % kHeaps].put();
    });
    threads.emplace_back([&] {
      while (left > 0) {
        for (const std::uint64_t user : ready(set_, 3, kPatience))
          if (heaps[user].take()) --left;
      }
      set_->wake();  // whoever waits for more
    });
  }
  threads.emplace_back([&] {
    for (int i = 0; i < 2000; ++i) {
      heaps[0].leave();
      Heap passing;
      EXPECT_TRUE(passing.join(set_, 1));
      passing.put();
      EXPECT_TRUE(heaps[0].join(set_, 0));
      if (i == 1000) static_cast<void>(set_->descriptor().or_throw());
    }
  });
  for (std::thread& thread : threads) thread.join();
  EXPECT_EQ(left, 0);
}

/// Into a set with a queue of a node.
template <class Visit>
bool join(const Set& set, const Visit& visit) {
  bool joined = false;
  visit([&](WaitSource& source, bool ready) { joined = source.join(set, {&set, 0, 1}, ready); });
  return joined;
}

class WaitSetOfANodeTest : public WaitSetTest {
 protected:
  void put(MessageKey key) {
    Message message = test::make_message("x", 1, key);
    EXPECT_TRUE(inbox_.put(key, message, nullptr));
  }
  Inbox inbox_{2, 1000, [] {}};
  MessageQueue& queue_ = inbox_.queue({1, 0}, nullptr);
  const Set any_ = std::make_shared<WaitSet>();
  Uplink uplink_;
};

TEST_F(WaitSetOfANodeTest, AQueueIsReadyWhileItHasMessages) {
  put({1, 0});
  EXPECT_TRUE(join(
      set_, [&](const SourceVisitor& visitor) { EXPECT_FALSE(inbox_.visit(queue_, visitor)); }));
  EXPECT_TRUE(join(any_, [&](const SourceVisitor& visitor) { inbox_.visit_any(visitor); }));
  EXPECT_EQ(ready(set_), Users{1});
  for (int i = 0; i < 3; ++i) put({1, 0});  // one is overwritten
  EXPECT_TRUE(inbox_.try_receive(queue_));
  EXPECT_EQ(ready(set_), Users{1});
  EXPECT_TRUE(inbox_.receive_any(kNoWait));
  EXPECT_EQ(ready(set_), Users{});
  EXPECT_EQ(ready(any_), Users{});
  put({1, 0});
  EXPECT_TRUE(inbox_.take_newest(queue_));
  EXPECT_EQ(ready(set_), Users{});
  put({2, 0});
  EXPECT_EQ(ready(set_), Users{});
  EXPECT_EQ(ready(any_), Users{1});
  EXPECT_TRUE(inbox_.receive_any(kNoWait));
  EXPECT_EQ(ready(any_), Users{});
  inbox_.end(Ending::closed());
  EXPECT_EQ(ready(set_), Users{1});
  EXPECT_EQ(ready(any_), Users{1});
}

TEST_F(WaitSetOfANodeTest, AQueueThatIsSilentIsTold) {
  MessageQueue& subscribed = inbox_.add_queue({}, Timeout{1});
  EXPECT_FALSE(inbox_.tick()) << "of no set";
  EXPECT_TRUE(join(
      set_, [&](const SourceVisitor& visitor) { EXPECT_FALSE(inbox_.visit(queue_, visitor)); }));
  const Set other = std::make_shared<WaitSet>();
  EXPECT_TRUE(join(other, [&](const SourceVisitor& visitor) {
    static_cast<void>(inbox_.visit(subscribed, visitor));
  }));
  while (ready(other).empty()) EXPECT_TRUE(inbox_.tick());
  EXPECT_TRUE(inbox_.receive(subscribed, kNoWait).is(Status::silence));
  EXPECT_EQ(ready(other), Users{});
  EXPECT_EQ(ready(set_), Users{});
  inbox_.end(Ending::closed());
  EXPECT_FALSE(inbox_.tick());
}

TEST_F(WaitSetOfANodeTest, AQueueThatGoesTakesItsMessagesAlong) {
  MessageQueue& subscribed = inbox_.add_queue({});
  EXPECT_TRUE(join(set_, [&](const SourceVisitor& visitor) {
    static_cast<void>(inbox_.visit(subscribed, visitor));
  }));
  EXPECT_TRUE(join(any_, [&](const SourceVisitor& visitor) { inbox_.visit_any(visitor); }));
  Message message = test::make_message("x", 1);
  EXPECT_TRUE(inbox_.put(subscribed, message, nullptr));
  EXPECT_EQ(ready(any_), Users{1});
  inbox_.remove(subscribed);
  EXPECT_EQ(ready(set_), Users{});
  EXPECT_EQ(ready(any_), Users{});
}

TEST_F(WaitSetOfANodeTest, AnAnsweringServiceIsReadyWhileRequestsWait) {
  AnswerQueue answers{uplink_, "calc/add", 1000};
  EXPECT_TRUE(join(set_, [&](const SourceVisitor& visitor) { answers.visit(visitor); }));
  EXPECT_EQ(ready(set_), Users{});
  Message late = test::make_message("x", 1);
  EXPECT_TRUE(answers.on_request({1, proto::gimi::MessageOperation::request, 0, 0, 7}, late, 0));
  EXPECT_EQ(ready(set_), Users{1});
  EXPECT_TRUE(answers.receive(kNoWait).is(Status::timeout));
  EXPECT_EQ(ready(set_), Users{});
  answers.end(Ending::closed());
  EXPECT_EQ(ready(set_), Users{1});
}

TEST_F(WaitSetOfANodeTest, AWatchIsReadyWhileEventsWait) {
  WatchQueue watch{uplink_};
  EXPECT_TRUE(join(set_, [&](const SourceVisitor& visitor) { watch.visit(visitor); }));
  watch.put({}, 1, false);
  EXPECT_EQ(ready(set_), Users{1});
  EXPECT_TRUE(watch.receive(kNoWait));
  EXPECT_EQ(ready(set_), Users{});
  watch.end(Ending::closed());
  EXPECT_EQ(ready(set_), Users{1});
}

}  // namespace
}  // namespace gimnet::gimi
