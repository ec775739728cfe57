#include <gtest/gtest.h>

#include <utility>
#include <vector>

#include "base/clock.hpp"
#include "client/gimi/message.hpp"
#include "gimnet/gimi/message.hpp"
#include "tests/client/gimi/support/made_message.hpp"

namespace gimnet {
namespace {

TEST(Peer, IsWrittenAndReadAsText) {
  EXPECT_EQ(Peer{(7u << 20) | 17}.text(), "7.17");
  EXPECT_EQ(Peer::parse("7.17"), (Peer{(7u << 20) | 17}));
  for (const char* text :
       {"", "7", "7.", ".17", "7.17.1", "robot", "7.1048576", "4096.1", "-7.1", "7#17"}) {
    EXPECT_FALSE(Peer::parse(text)) << text;
  }
}

TEST(Message, TellsWhatItIs) {
  const Message message = test::make_message("hello", 9, {1, 2});
  EXPECT_EQ(message.text(), "hello");
  EXPECT_EQ(message.size(), 5u);
  EXPECT_EQ(message.from().text(), "7.5");
  EXPECT_EQ(message.key(), (MessageKey{1, 2}));
  EXPECT_EQ(message.lane(), Lane::bulk);
  EXPECT_EQ(message.sequence(), 9u);
  EXPECT_EQ(message.arrival_ns(), 1000);
  EXPECT_FALSE(message.sent_ns());
  EXPECT_EQ(message.service(), "");
}

TEST(Message, Moves) {
  Message first = test::make_message("first");
  Message second = std::move(first);
  EXPECT_EQ(second.text(), "first");
  first = test::make_message("other");
  second = std::move(first);
  EXPECT_EQ(second.text(), "other");
}

TEST(Message, ItsMemoryIsGivenBackOnce) {
  auto* const storage = nif::Slab::make();
  storage->add_reference();
  nif_incoming in{};
  in.storage = static_cast<nif::Storage*>(storage);
  gimi_message message = gimi::make_message(in, {}, nullptr, 0).give_up();
  EXPECT_FALSE(storage->is_only_reference());
  gimi_message_release(&message);
  EXPECT_TRUE(storage->is_only_reference());
  EXPECT_EQ(message.storage, nullptr);
  gimi_message_release(&message);
  gimi_message_release(nullptr);
  EXPECT_TRUE(storage->is_only_reference());
  storage->release();
}

TEST(Message, TellsItsAgeIfThatIsKnown) {
  Message message = test::make_message("x");
  EXPECT_FALSE(message.age());
  std::int64_t age_ns = 7;
  EXPECT_EQ(gimi_message_age(&message.c_message(), &age_ns, nullptr), GIMI_NOT_FOUND);
  EXPECT_EQ(age_ns, 0);
  EXPECT_EQ(gimi_message_age(nullptr, &age_ns, nullptr), GIMI_BAD_ARGUMENT);
  constexpr std::int64_t kBefore = 1'000'000'000;
  const std::int64_t then = steady_now_ns();
  message = gimi::born_at(std::move(message), then - kBefore, 30);
  const auto age = message.age();
  ASSERT_TRUE(age);
  EXPECT_GE(age->age_ns, kBefore);
  EXPECT_LE(age->age_ns, kBefore + steady_now_ns() - then);
  EXPECT_EQ(age->error_ns, 30);
  EXPECT_EQ(gimi_message_age(&message.c_message(), nullptr, nullptr), GIMI_OK);
  message = gimi::born_at(std::move(message), then + 60 * kBefore, 30);
  EXPECT_EQ(message.age()->age_ns, 0) << "a clock is wrong by more than its age";
}

TEST(BytesView, LooksAtAnyBytes) {
  const std::string text = "abc";
  const std::vector<std::byte> bytes{std::byte{1}, std::byte{2}};
  const std::vector<unsigned char> letters{1, 2, 3, 4};
  EXPECT_EQ(BytesView("ab").size(), 2u);
  EXPECT_EQ(BytesView(text).size(), 3u);
  EXPECT_EQ(BytesView(bytes).data(), bytes.data());
  EXPECT_EQ(BytesView(letters).size(), 4u);
  EXPECT_EQ(BytesView().size(), 0u);
}

}  // namespace
}  // namespace gimnet
