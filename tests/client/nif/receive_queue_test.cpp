#include "client/nif/receive_queue.hpp"

#include <gtest/gtest.h>

#include <array>
#include <string>
#include <thread>

#include "client/nif/inbound.hpp"

namespace gimnet::nif::test {
namespace {

Item event(const std::string& text, std::size_t bytes = 0) {
  Item item = item_of(make_event(NIF_GAP, text), 0);
  item.bytes = bytes;
  return item;
}

void push(ReceiveQueue& queue, const std::string& text, std::size_t bytes = 0) {
  const Item item = event(text, bytes);
  queue.push(std::span(&item, 1));
}

std::string pop(ReceiveQueue& queue, Deadline deadline = 0) {
  nif_incoming in;
  std::size_t count = 0;
  if (queue.pop(std::span(&in, 1), count, deadline) != NIF_OK) return "nothing";
  std::string text = in.text;
  nif_release(&in);
  return text;
}

TEST(ReceiveQueue, GivesOutInOrder) {
  net::WakeSignal wake;
  ReceiveQueue queue(1000, wake);
  push(queue, "a");
  push(queue, "b");
  EXPECT_EQ(pop(queue), "a");
  EXPECT_EQ(pop(queue), "b");
  EXPECT_EQ(pop(queue), "nothing");
}

TEST(ReceiveQueue, GivesOutManyAtOnce) {
  net::WakeSignal wake;
  ReceiveQueue queue(1u << 20, wake);
  for (int i = 0; i < 10; ++i) push(queue, std::to_string(i));
  std::array<nif_incoming, 7> in;
  std::size_t count = 0;
  ASSERT_EQ(queue.pop(in, count, 0), NIF_OK);
  ASSERT_EQ(count, 7u);
  EXPECT_STREQ(in[6].text, "6");
  for (nif_incoming& each : in) nif_release(&each);
  EXPECT_EQ(pop(queue), "7");
}

TEST(ReceiveQueue, IsFullAtItsLimitAndHasRoomAgainAtTheHalf) {
  net::WakeSignal wake;
  const std::size_t cost = 100 + sizeof(Item);
  ReceiveQueue queue(4 * cost, wake);
  for (int i = 0; i < 3; ++i) push(queue, "x", 100);
  EXPECT_TRUE(queue.has_room());
  push(queue, "x", 100);
  EXPECT_FALSE(queue.has_room());
  EXPECT_EQ(queue.stops(), 1u);
  for (int i = 0; i < 2; ++i) EXPECT_EQ(pop(queue), "x");
  EXPECT_FALSE(net::wait_for(nullptr, {}, wake, 0).woken);
  EXPECT_FALSE(queue.has_room()) << "half is not less than half";
  EXPECT_EQ(pop(queue), "x");
  EXPECT_TRUE(net::wait_for(nullptr, {}, wake, 0).woken);
  EXPECT_TRUE(queue.has_room());
}

TEST(ReceiveQueue, HoldsOneMessageOfAnySize) {
  net::WakeSignal wake;
  ReceiveQueue queue(10, wake);
  EXPECT_TRUE(queue.has_room());
  push(queue, "huge", 1u << 30);
  EXPECT_FALSE(queue.has_room());
  EXPECT_EQ(pop(queue), "huge");
  EXPECT_TRUE(queue.has_room());
}

TEST(ReceiveQueue, WaitersGetWhatComesOrTheEnd) {
  net::WakeSignal wake;
  ReceiveQueue queue(1000, wake);
  std::thread waiting([&] { EXPECT_EQ(pop(queue, kNever), "late"); });
  push(queue, "late");
  waiting.join();
  push(queue, "last");
  queue.end({NIF_REPLACED, "taken over"});
  EXPECT_EQ(pop(queue, kNever), "last") << "what came before the end still comes";
  nif_incoming in;
  std::size_t count = 0;
  EXPECT_EQ(queue.pop(std::span(&in, 1), count, kNever), NIF_REPLACED);
  push(queue, "stays");
  queue.close();
  EXPECT_EQ(queue.pop(std::span(&in, 1), count, kNever), NIF_CLOSED);
}

TEST(ReceiveQueue, AConsumerMayGiveBackWhatItHasNoRoomFor) {
  net::WakeSignal wake;
  ReceiveQueue queue(1u << 20, wake);
  std::array<Item, 3> items;
  EXPECT_EQ(queue.take(items), 0u);
  for (const char* text : {"a", "b", "c", "d"}) push(queue, text, 100);
  const std::size_t bytes = queue.bytes();
  ASSERT_EQ(queue.take(items), 3u) << "as many as fit";
  EXPECT_LT(queue.bytes(), bytes);
  nif_incoming in = incoming_of(items[0]);
  EXPECT_STREQ(in.text, "a");
  nif_release(&in);
  queue.give_back(std::span(items).subspan(1));
  for (const char* text : {"b", "c", "d"}) EXPECT_EQ(pop(queue), text);
  EXPECT_EQ(queue.bytes(), 0u);
}

TEST(ReceiveQueue, ThereIsRoomOnlyForWhatIsNotGivenBack) {
  net::WakeSignal wake;
  const std::size_t cost = 100 + sizeof(Item);
  ReceiveQueue queue(2 * cost, wake);
  for (int i = 0; i < 2; ++i) push(queue, "x", 100);
  EXPECT_FALSE(queue.has_room());
  std::array<Item, 2> items;
  ASSERT_EQ(queue.take(items), 2u);
  queue.give_back(items);
  EXPECT_FALSE(queue.has_room());
  EXPECT_EQ(queue.stops(), 1u) << "it is still the same stop";
  ASSERT_EQ(queue.take(items), 2u);
  queue.give_back({});
  EXPECT_TRUE(net::wait_for(nullptr, {}, wake, 0).woken);
  EXPECT_TRUE(queue.has_room());
  for (Item& item : items) item.storage->release();
}

TEST(ReceiveQueue, ItsDescriptorFollowsWhetherSomethingWaits) {
  net::WakeSignal wake;
  ReceiveQueue queue(1000, wake);
  push(queue, "before it was asked for");
  EXPECT_GE(queue.event_descriptor(), 0);
  EXPECT_EQ(queue.event_descriptor(), queue.event_descriptor());
}

}  // namespace
}  // namespace gimnet::nif::test
