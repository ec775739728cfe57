#include "client/nif/last_messages.hpp"

#include <gtest/gtest.h>

#include <array>
#include <string>

#include "proto/gimi/message_header.hpp"

namespace gimnet::nif::test {
namespace {

constexpr std::uint32_t kGroup = 11;

void keep(LastMessages& messages, const std::string& payload, std::uint32_t group = kGroup) {
  const nif_bytes parts[] = {
      {payload.data(), payload.size() / 2},
      {payload.data() + payload.size() / 2, payload.size() - payload.size() / 2}};
  nif_outgoing outgoing = NIF_OUTGOING_INIT;
  outgoing.kind = NIF_GROUP;
  outgoing.to = group;
  outgoing.lane = NIF_BULK;
  outgoing.flags = NIF_FLAG_KEYED;
  outgoing.key = 77;
  outgoing.age_ms_max = 5'000;
  outgoing.parts = parts;
  outgoing.part_count = 2;
  Outgoing message;
  ASSERT_FALSE(message.read(outgoing));
  messages.keep(message);
}

std::string text_of(const LastMessages& messages, const std::string& service = "map") {
  const LastMessage* const last = messages.find(service);
  return last == nullptr ? "nothing"
                         : std::string(reinterpret_cast<const char*>(last->payload.data()),
                                       last->payload.size());
}

TEST(LastMessages, KeepsTheLastOfEachRetainedServiceWhole) {
  LastMessages messages;
  EXPECT_TRUE(messages.empty());
  messages.follow("map", kGroup);
  messages.follow("plan", 12);
  EXPECT_FALSE(messages.empty());
  EXPECT_EQ(text_of(messages), "nothing");
  for (const char* payload : {"a long first one", "old", "new"}) keep(messages, payload);
  keep(messages, "", 12);
  keep(messages, "of no retained service", 13);
  EXPECT_EQ(text_of(messages), "new");
  EXPECT_EQ(text_of(messages, "plan"), "");
  const proto::FrameParts parts = messages.find("map")->parts();
  EXPECT_EQ(parts.header.kind, proto::Kind::group);
  EXPECT_EQ(parts.header.dst, kGroup);
  EXPECT_EQ(parts.header.lane, NIF_BULK);
  EXPECT_EQ(parts.key, 77u);
  EXPECT_FALSE(parts.extensions.empty()) << "its age goes on";
}

TEST(LastMessages, GoesWithItsServiceToAnotherGroup) {
  LastMessages messages;
  messages.follow("map", 11);
  messages.follow("plan", 12);
  keep(messages, "map", 11);
  keep(messages, "plan", 12);
  messages.follow("map", 12);
  messages.follow("plan", 11);
  EXPECT_EQ(messages.find("map")->parts().header.dst, 12u);
  keep(messages, "second map", 12);
  keep(messages, "second plan", 11);
  EXPECT_EQ(text_of(messages), "second map");
  EXPECT_EQ(text_of(messages, "plan"), "second plan");
}

TEST(LastMessages, StaysWhileItsServiceHasNoGroup) {
  LastMessages messages;
  messages.follow("map", kGroup);
  keep(messages, "map");
  messages.follow("map", 0);
  EXPECT_EQ(messages.find("map"), nullptr);
  keep(messages, "to a group that is no longer its");
  messages.follow("map", 20);
  EXPECT_EQ(text_of(messages), "map");
  messages.forget("map");
  messages.forget("map");
  EXPECT_EQ(messages.find("map"), nullptr);
  EXPECT_EQ(messages.bytes(), 0u);
  EXPECT_TRUE(messages.empty());
}

TEST(LastMessages, LeavesNoOlderOneInThePlaceOfOneThatIsTooLarge) {
  LastMessages messages;
  messages.follow("map", kGroup);
  keep(messages, std::string(LastMessages::kMessageBytesDefault, 'x'));
  EXPECT_EQ(text_of(messages).size(), LastMessages::kMessageBytesDefault);
  EXPECT_EQ(messages.bytes(), LastMessages::kMessageBytesDefault);
  keep(messages, std::string(LastMessages::kMessageBytesDefault + 1, 'x'));
  EXPECT_EQ(messages.find("map"), nullptr);
  EXPECT_EQ(messages.bytes(), 0u);
  keep(messages, "small");
  EXPECT_EQ(text_of(messages), "small");
}

TEST(LastMessages, KeepsAsMuchOfOneAsItIsToldAndCountsTheRest) {
  LastMessages messages(10);
  messages.follow("map", kGroup);
  keep(messages, std::string(10, 'x'));
  EXPECT_EQ(text_of(messages), std::string(10, 'x'));
  keep(messages, std::string(11, 'x'), 13);
  EXPECT_EQ(messages.not_kept(), 0u) << "of no retained service";
  keep(messages, std::string(11, 'x'));
  EXPECT_EQ(text_of(messages), "nothing");
  EXPECT_EQ(messages.not_kept(), 1u);
}

TEST(LastMessages, CountsApplicationDataOnly) {
  std::array<std::byte, proto::gimi::kMessagePrefixMax> prefix;
  const std::size_t size = proto::gimi::write_message_prefix({.sequence = 1}, 12'345, prefix);
  const std::string head(reinterpret_cast<const char*>(prefix.data()), size);
  LastMessages messages(10);
  messages.follow("map", kGroup);
  keep(messages, head + std::string(10, 'x'));
  EXPECT_EQ(text_of(messages), head + std::string(10, 'x'));
  keep(messages, head + std::string(11, 'x'));
  EXPECT_EQ(text_of(messages), "nothing");
}

TEST(LastMessages, OfAllServicesKeepsWhatFitsIntoTheLimit) {
  constexpr std::uint32_t kFull = LastMessages::kBytesMax / LastMessages::kMessageBytesDefault;
  const std::string largest(LastMessages::kMessageBytesDefault, 'x');
  LastMessages messages;
  for (std::uint32_t i = 1; i <= kFull; ++i) {
    messages.follow(std::to_string(i), i);
    keep(messages, largest, i);
  }
  EXPECT_EQ(messages.bytes(), LastMessages::kBytesMax);
  messages.follow("map", 1'000);
  keep(messages, "x", 1'000);
  EXPECT_EQ(text_of(messages), "nothing") << "one byte beyond";
  keep(messages, "y" + largest.substr(1), 1);
  EXPECT_EQ(text_of(messages, "1")[0], 'y') << "what is there already has its place";
  keep(messages, "small", 1);
  keep(messages, "x", 1'000);
  EXPECT_EQ(text_of(messages), "x");
  EXPECT_EQ(messages.bytes(), LastMessages::kBytesMax - LastMessages::kMessageBytesDefault + 5 + 1);
}

}  // namespace
}  // namespace gimnet::nif::test
