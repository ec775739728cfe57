#include "proto/bitestream/writer.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cstddef>
#include <cstdint>
#include <string>
#include <utility>
#include <vector>

#include "proto/bitestream/reader.hpp"
#include "tests/vectors/vector_file.hpp"

namespace gimnet::proto::bitestream {
namespace {

using test::Bytes;
using test::from_hex;
using test::load_vector;
using test::to_bytes;

template <class T>
std::vector<T> two(T first, T second) {
  return {first, second};
}

void put_scalars(Writer& writer) {
  const auto opaque = from_hex("00 ff");
  writer.put_opaque(1, opaque);
  writer.put_bool(2, true);
  writer.put_u8(3, 200);
  writer.put_u16(4, 60000);
  writer.put_u32(5, 4000000000);
  writer.put_u64(6, UINT64_MAX);
  writer.put_i8(7, -100);
  writer.put_i16(8, -30000);
  writer.put_i32(9, -2000000000);
  writer.put_i64(10, INT64_MIN);
  writer.put_f32(11, 1.5f);
  writer.put_f64(12, -0.1);
  writer.put_text(13, "\u00e4\u20ac");
  writer.put_time(14, 1767225600000000000);
}

void put_arrays(Writer& writer) {
  const std::array<bool, 2> flags{true, false};
  writer.put_array(16, std::span<const bool>(flags));
  writer.put_array(17, two<std::uint8_t>(1, 2));
  writer.put_array(18, two<std::uint16_t>(1, 2));
  writer.put_array(19, two<std::uint32_t>(1, 2));
  writer.put_array(20, two<std::uint64_t>(1, 2));
  writer.put_array(21, two<std::int8_t>(-1, 2));
  writer.put_array(22, two<std::int16_t>(-1, 2));
  writer.put_array(23, two<std::int32_t>(-1, 2));
  writer.put_array(24, two<std::int64_t>(-1, 2));
  writer.put_array(25, two(0.5f, -2.0f));
  writer.put_array(26, two(0.5, -2.0));
  writer.put_time_array(27, two<std::int64_t>(0, 1));
}

TEST(BitestreamWriter, WritesTheExampleOfTheDocument) {
  Writer writer;
  writer.put_text(3, "robot");
  writer.put_f64("v", 0.5);
  ASSERT_EQ(writer.finish(), BITESTREAM_OK);
  EXPECT_EQ(to_bytes(writer.bytes()), load_vector("bitestream/example"));
}

TEST(BitestreamWriter, WritesEveryType) {
  Writer writer;
  put_scalars(writer);
  writer.begin_nested(15);
  writer.put_u8(1, 1);
  writer.end_nested();
  put_arrays(writer);
  ASSERT_EQ(writer.finish(), BITESTREAM_OK);
  EXPECT_EQ(to_bytes(writer.bytes()), load_vector("bitestream/every_type"));
}

TEST(BitestreamWriter, WritesIntoTheCallersMemory) {
  const auto expected = load_vector("bitestream/example");
  for (std::size_t room = 0; room <= expected.size(); ++room) {
    Bytes memory(expected.size(), std::byte{0xEE});
    Writer writer{std::span(memory).first(room)};
    writer.put_text(3, "robot");
    writer.put_f64("v", 0.5);
    EXPECT_EQ(writer.finish(), room == expected.size() ? BITESTREAM_OK : BITESTREAM_NO_ROOM)
        << room;
    for (std::size_t i = room; i < memory.size(); ++i) EXPECT_EQ(memory[i], std::byte{0xEE});
  }
}

TEST(BitestreamWriter, UsesTheSmallestLengthField) {
  for (const auto& [size, field] :
       {std::pair<std::size_t, std::size_t>{1, 1}, {255, 1}, {256, 2}, {65535, 2}, {65536, 4}}) {
    Writer writer;
    writer.put_text(1, std::string(size, 'x'));
    EXPECT_EQ(writer.size(), 1 + 3 + field + size);
    Writer nested;
    nested.begin_nested(1);
    nested.put_opaque(2, Bytes(size - std::min<std::size_t>(size, 5)));
    nested.end_nested();
    EXPECT_EQ(nested.finish(), BITESTREAM_OK);
    EXPECT_TRUE(is_valid(nested.bytes())) << size;
  }
  Writer writer;
  writer.put_text("long", std::string(300, 'x'));
  EXPECT_EQ(to_bytes(writer.bytes()), load_vector("bitestream/long_text"));
}

TEST(BitestreamWriter, MovesNestedContentForALongerLength) {
  for (const std::size_t size : {200u, 300u, 70'000u}) {
    Writer writer;
    writer.begin_nested("outer");
    writer.begin_nested(1);
    writer.put_text(2, std::string(size, 'x'));
    writer.end_nested();
    writer.put_u8(3, 4);
    writer.end_nested();
    ASSERT_EQ(writer.finish(), BITESTREAM_OK);
    const auto outer = Reader(writer.bytes()).find("outer")->as_nested();
    ASSERT_TRUE(outer);
    EXPECT_EQ(outer->find(1)->as_nested()->find(2)->as_text(), std::string(size, 'x'));
    EXPECT_EQ(outer->find(3)->as<int>(), 4);
  }
}

TEST(BitestreamWriter, LeavesOutValuesOfNoBytes) {
  Writer writer;
  writer.put_text(1, "");
  writer.put_opaque(2, {});
  writer.put_array(3, std::span<const double>());
  writer.begin_nested(4);
  writer.begin_nested(5);
  writer.end_nested();
  writer.end_nested();
  EXPECT_EQ(writer.finish(), BITESTREAM_OK);
  EXPECT_EQ(writer.size(), 0u);
}

TEST(BitestreamWriter, BoundsKeys) {
  const std::string longest(255, 'k');
  const std::string too_long(256, 'k');
  const auto status = [](const Key& key) {
    Writer writer;
    writer.put_u8(key, 1);
    return writer.finish();
  };
  EXPECT_EQ(status(0u), BITESTREAM_OK);
  EXPECT_EQ(status(BITESTREAM_KEY_NUMBER_MAX), BITESTREAM_OK);
  EXPECT_EQ(status(BITESTREAM_KEY_NUMBER_MAX + 1), BITESTREAM_BAD_KEY);
  EXPECT_EQ(status(std::string_view(longest)), BITESTREAM_OK);
  EXPECT_EQ(status(std::string_view(too_long)), BITESTREAM_BAD_KEY);
  EXPECT_EQ(status(""), BITESTREAM_BAD_KEY);
  EXPECT_EQ(status("\xFF"), BITESTREAM_BAD_KEY);
}

TEST(BitestreamWriter, BoundsNesting) {
  Writer writer;
  for (int i = 0; i < 16; ++i) writer.begin_nested(1);
  writer.put_u8(1, 1);
  for (int i = 0; i < 16; ++i) writer.end_nested();
  ASSERT_EQ(writer.finish(), BITESTREAM_OK);
  EXPECT_EQ(to_bytes(writer.bytes()), load_vector("bitestream/nested_16_deep"));

  Writer deeper;
  for (int i = 0; i < 17; ++i) deeper.begin_nested(1);
  EXPECT_EQ(deeper.finish(), BITESTREAM_TOO_DEEP);
}

TEST(BitestreamWriter, SaysWhenNestingIsNotBalanced) {
  Writer open;
  open.begin_nested(1);
  EXPECT_EQ(open.finish(), BITESTREAM_NOT_BALANCED);
  Writer closed;
  closed.end_nested();
  EXPECT_EQ(closed.finish(), BITESTREAM_NOT_BALANCED);
}

TEST(BitestreamWriter, RefusesWhatAReaderWouldRefuse) {
  const auto status = [](Type type, std::string_view hex) {
    Writer writer;
    writer.put_value(1, type, from_hex(hex));
    return writer.finish();
  };
  EXPECT_EQ(status(BITESTREAM_TEXT, "ff"), BITESTREAM_BAD_VALUE);
  EXPECT_EQ(status(BITESTREAM_BOOL, "02"), BITESTREAM_BAD_VALUE);
  EXPECT_EQ(status(BITESTREAM_BOOL_ARRAY, "01 02"), BITESTREAM_BAD_VALUE);
  EXPECT_EQ(status(BITESTREAM_U32, "01 02 03"), BITESTREAM_BAD_VALUE);
  EXPECT_EQ(status(BITESTREAM_U32, ""), BITESTREAM_BAD_VALUE);
  EXPECT_EQ(status(BITESTREAM_U32_ARRAY, "01 02 03 04 05"), BITESTREAM_BAD_VALUE);
  EXPECT_EQ(status(BITESTREAM_NESTED, "01"), BITESTREAM_BAD_VALUE);
  EXPECT_EQ(status(static_cast<Type>(15), "01"), BITESTREAM_BAD_VALUE);
  EXPECT_EQ(status(static_cast<Type>(28), "01"), BITESTREAM_BAD_VALUE);
  EXPECT_EQ(status(BITESTREAM_U32, "01 02 03 04"), BITESTREAM_OK);
}

TEST(BitestreamWriter, KeepsItsFirstError) {
  Writer writer;
  writer.put_u8(1, 1);
  const std::size_t size = writer.size();
  writer.put_u8("", 1);
  writer.put_u8(2, 1);
  writer.end_nested();
  EXPECT_EQ(writer.finish(), BITESTREAM_BAD_KEY);
  EXPECT_EQ(writer.size(), size);
}

TEST(BitestreamWriter, MovesItsMemory) {
  Writer from;
  from.put_u8(1, 1);
  Writer to(std::move(from));
  to.put_u8(2, 2);
  Writer assigned;
  assigned = std::move(to);
  EXPECT_EQ(Reader(assigned.bytes()).find(2)->as<int>(), 2);
}

}  // namespace
}  // namespace gimnet::proto::bitestream
