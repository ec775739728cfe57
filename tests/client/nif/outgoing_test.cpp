#include "client/nif/outgoing.hpp"

#include <gtest/gtest.h>

#include <cstddef>
#include <string>
#include <vector>

#include "proto/frame/frame_parser.hpp"

namespace gimnet::nif::test {
namespace {

nif_status read(const nif_outgoing& message) {
  Outgoing outgoing;
  const auto failure = outgoing.read(message);
  return failure ? failure->status : NIF_OK;
}

nif_outgoing message_to(std::uint32_t to) {
  nif_outgoing message = NIF_OUTGOING_INIT;
  message.to = to;
  return message;
}

TEST(Outgoing, ChecksEveryField) {
  const nif_outgoing good = message_to((7u << 20) | 1);
  EXPECT_EQ(read(good), NIF_OK);
  const auto bad = [&good](auto change) {
    nif_outgoing message = good;
    change(message);
    return read(message);
  };
  EXPECT_EQ(bad([](auto& m) { m.struct_size = 3; }), NIF_BAD_ARGUMENT);
  EXPECT_EQ(bad([](auto& m) { m.kind = 5; }), NIF_BAD_ARGUMENT);
  EXPECT_EQ(bad([](auto& m) { m.lane = 4; }), NIF_BAD_ARGUMENT);
  EXPECT_EQ(bad([](auto& m) { m.policy = 4; }), NIF_BAD_ARGUMENT);
  EXPECT_EQ(bad([](auto& m) { m.flags = 16; }), NIF_BAD_ARGUMENT);
  EXPECT_EQ(bad([](auto& m) { m.trace_slots = 9; }), NIF_BAD_ARGUMENT);
  EXPECT_EQ(bad([](auto& m) { m.policy = NIF_LATEST; }), NIF_BAD_ARGUMENT) << "no key";
  EXPECT_EQ(bad([](auto& m) { m.part_count = 1; }), NIF_BAD_ARGUMENT) << "parts is NULL";
  EXPECT_EQ(bad([](auto& m) { m.to = (7u << 20) | 0xFFFFF; }), NIF_BAD_ARGUMENT) << "every node";
  EXPECT_EQ(bad([](auto& m) { m.kind = NIF_BROADCAST; }), NIF_BAD_ARGUMENT) << "one node";
  EXPECT_EQ(bad([](auto& m) {
              m.kind = NIF_GROUP;
              m.policy = NIF_BLOCK;
            }),
            NIF_BAD_ARGUMENT);
}

TEST(Outgoing, AnOlderProgramGivesAShorterStruct) {
  nif_outgoing message = message_to((7u << 20) | 1);
  message.trace_slots = 9;  // what stands there is none of its
  message.struct_size = offsetof(nif_outgoing, trace_slots);
  EXPECT_EQ(read(message), NIF_OK);
}

TEST(Outgoing, ANewerProgramMayNotAskForWhatIsNotThere) {
  struct Newer {
    nif_outgoing known;
    std::uint64_t more;
  } message{message_to((7u << 20) | 1), 0};
  message.known.struct_size = sizeof message;
  EXPECT_EQ(read(message.known), NIF_OK);
  message.more = 1;
  EXPECT_EQ(read(message.known), NIF_BAD_ARGUMENT);
}

TEST(Outgoing, SortsRecipientsAndCountsThemOnce) {
  const std::vector<std::uint32_t> ids{5, 3, 5, 4};
  nif_outgoing message = message_to(0);
  message.kind = NIF_LIST;
  message.recipients = ids.data();
  message.recipient_count = ids.size();
  Outgoing outgoing;
  ASSERT_FALSE(outgoing.read(message));
  std::vector<std::byte> frame(proto::prefix_size(outgoing.parts()));
  outgoing.write_frame(frame, 1, std::nullopt, 0, 0, false);
  const auto view = proto::parse_frame(frame, proto::Origin::node);
  ASSERT_TRUE(view);
  EXPECT_EQ(view->header.dst, 3u);
  EXPECT_EQ(view->recipients[0].value(), 3u);
  EXPECT_EQ(view->recipients[2].value(), 5u);
}

TEST(Outgoing, TakesUpTo1024Recipients) {
  const std::vector<std::uint32_t> ids(1025, 7);
  nif_outgoing message = message_to(0);
  message.kind = NIF_LIST;
  EXPECT_EQ(read(message), NIF_BAD_ARGUMENT) << "none";
  message.recipients = ids.data();
  message.recipient_count = 1024;
  EXPECT_EQ(read(message), NIF_OK);
  message.recipient_count = 1025;
  EXPECT_EQ(read(message), NIF_BAD_ARGUMENT);
}

TEST(Outgoing, RefusesMoreThanAGibibyteWithoutTouchingIt) {
  const char byte = 0;
  const nif_bytes parts[2] = {{&byte, NIF_MESSAGE_BYTES_MAX}, {&byte, 1}};
  nif_outgoing message = message_to(1);
  message.parts = parts;
  message.part_count = 1;
  EXPECT_EQ(read(message), NIF_OK);
  message.part_count = 2;
  EXPECT_EQ(read(message), NIF_TOO_LARGE);
}

TEST(Outgoing, GathersAnyPieceOfAnyParts) {
  const std::string text = "abcdefghij";
  const nif_bytes parts[4] = {
      {text.data(), 3}, {nullptr, 0}, {text.data() + 3, 1}, {text.data() + 4, 6}};
  nif_outgoing message = message_to(1);
  message.parts = parts;
  message.part_count = 4;
  Outgoing outgoing;
  ASSERT_FALSE(outgoing.read(message));
  ASSERT_EQ(outgoing.size(), 10u);
  for (std::uint32_t offset = 0; offset < 10; ++offset) {
    for (std::uint32_t size = 1; offset + size <= 10; ++size) {
      std::vector<std::byte> frame(proto::prefix_size(outgoing.parts()) + size);
      outgoing.write_frame(frame, 1, std::nullopt, offset, size, false);
      const auto* payload = reinterpret_cast<const char*>(frame.data()) + proto::kHeaderSize;
      EXPECT_EQ(std::string(payload, size), text.substr(offset, size));
    }
  }
}

TEST(Outgoing, WritesKeyAgeAndTrace) {
  nif_outgoing message = message_to(1);
  message.flags = NIF_FLAG_KEYED | NIF_FLAG_REPORT;
  message.key = 0x0102030405060708;
  message.age_ms_max = 100;
  message.trace_slots = 8;
  message.policy = NIF_LATEST;
  Outgoing outgoing;
  ASSERT_FALSE(outgoing.read(message));
  EXPECT_TRUE(outgoing.replaceable());
  EXPECT_TRUE(outgoing.reported());
  std::vector<std::byte> frame(proto::prefix_size(outgoing.parts()));
  outgoing.write_frame(frame, 1, std::nullopt, 0, 0, false);
  const auto view = proto::parse_frame(frame, proto::Origin::node);
  ASSERT_TRUE(view);
  EXPECT_EQ(view->key, message.key);
  EXPECT_EQ(proto::find_age(view->extensions)->longest_ms, 100u);
  EXPECT_EQ(proto::find_trace(view->extensions)->slots(), 8u);
}

}  // namespace
}  // namespace gimnet::nif::test
