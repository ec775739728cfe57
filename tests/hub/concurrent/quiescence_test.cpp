#include "hub/concurrent/quiescence.hpp"

#include <gtest/gtest.h>

#include <atomic>
#include <memory>
#include <thread>
#include <vector>

namespace gimnet::hub {
namespace {

TEST(Quiescence, ReadersThatAreAwayHoldNothing) {
  Quiescence quiescence(3);
  EXPECT_TRUE(quiescence.passed(quiescence.ticket()));
}

TEST(Quiescence, WaitsForEveryReaderThatWasInside) {
  Quiescence quiescence(2);
  quiescence.enter(0);
  quiescence.enter(1);
  const std::uint64_t ticket = quiescence.ticket();
  EXPECT_FALSE(quiescence.passed(ticket));
  quiescence.enter(0);
  EXPECT_FALSE(quiescence.passed(ticket)) << "the other one is still inside";
  quiescence.leave(1);
  EXPECT_TRUE(quiescence.passed(ticket));
}

TEST(Quiescence, AReaderThatEnteredAfterwardsDoesNotMatter) {
  Quiescence quiescence(1);
  const std::uint64_t ticket = quiescence.ticket();
  quiescence.enter(0);
  EXPECT_TRUE(quiescence.passed(ticket));
  const std::uint64_t next = quiescence.ticket();
  EXPECT_FALSE(quiescence.passed(next));
}

// Provable: what the writer frees after passed() is not looked at by a reader any more. A freed
// value is poisoned first, so a reader that still looks sees the poison (and a sanitizer the race).
TEST(Quiescence, NothingIsFreedUnderAReader) {
  constexpr int kSwaps = 2'000;
  constexpr std::uint64_t kPoison = 0xDEAD;
  struct Value {
    std::atomic<std::uint64_t> number{0};
  };
  Quiescence quiescence(2);
  std::atomic<Value*> shown{new Value};
  std::atomic<bool> stop{false};
  std::vector<std::thread> readers;
  for (std::size_t r = 0; r < 2; ++r) {
    readers.emplace_back([&, r] {
      while (!stop.load()) {
        quiescence.enter(r);
        for (int i = 0; i < 10; ++i) {
          const Value* value = shown.load(std::memory_order_acquire);
          ASSERT_NE(value->number.load(std::memory_order_relaxed), kPoison);
        }
        if (r == 1) quiescence.leave(r);
      }
      quiescence.leave(r);
    });
  }
  for (int i = 0; i < kSwaps; ++i) {
    std::unique_ptr<Value> old(shown.exchange(new Value, std::memory_order_acq_rel));
    const std::uint64_t ticket = quiescence.ticket();
    while (!quiescence.passed(ticket)) std::this_thread::yield();
    old->number.store(kPoison, std::memory_order_relaxed);
  }
  stop = true;
  for (std::thread& reader : readers) reader.join();
  delete shown.load();
}

}  // namespace
}  // namespace gimnet::hub
