#include "proto/bitestream/reader.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "tests/vectors/vector_file.hpp"

namespace gimnet::proto::bitestream {
namespace {

using test::Bytes;
using test::from_hex;
using test::load_vector;
using test::to_bytes;

TEST(BitestreamReader, ReadsTheExampleOfTheDocument) {
  const auto bytes = load_vector("bitestream/example");
  Reader reader(bytes);
  const auto name = reader.next();
  ASSERT_TRUE(name);
  EXPECT_FALSE(name->key().is_text());
  EXPECT_EQ(name->key().number(), 3u);
  EXPECT_EQ(name->as_text(), "robot");
  const auto v = reader.next();
  ASSERT_TRUE(v);
  EXPECT_EQ(v->key().text(), "v");
  EXPECT_EQ(v->as<double>(), 0.5);
  EXPECT_FALSE(reader.next());
  EXPECT_FALSE(reader.failed());
}

TEST(BitestreamReader, ReadsEveryScalar) {
  const auto bytes = load_vector("bitestream/every_type");
  ASSERT_TRUE(is_valid(bytes));
  const Reader reader(bytes);
  EXPECT_EQ(to_bytes(*reader.find(1)->as_opaque()), from_hex("00 ff"));
  EXPECT_EQ(reader.find(2)->as_bool(), true);
  EXPECT_EQ(reader.find(3)->as<std::uint8_t>(), 200);
  EXPECT_EQ(reader.find(4)->as<std::uint16_t>(), 60000);
  EXPECT_EQ(reader.find(5)->as<std::uint32_t>(), 4000000000);
  EXPECT_EQ(reader.find(6)->as<std::uint64_t>(), UINT64_MAX);
  EXPECT_EQ(reader.find(7)->as<std::int8_t>(), -100);
  EXPECT_EQ(reader.find(8)->as<std::int16_t>(), -30000);
  EXPECT_EQ(reader.find(9)->as<std::int32_t>(), -2000000000);
  EXPECT_EQ(reader.find(10)->as<std::int64_t>(), INT64_MIN);
  EXPECT_EQ(reader.find(11)->as<float>(), 1.5f);
  EXPECT_EQ(reader.find(12)->as<double>(), -0.1);
  EXPECT_EQ(reader.find(13)->as_text(), "\u00e4\u20ac");
  EXPECT_EQ(reader.find(14)->as_time(), 1767225600000000000);
  EXPECT_EQ(reader.find(15)->as_nested()->find(1)->as<int>(), 1);
}

TEST(BitestreamReader, ReadsEveryArray) {
  const auto bytes = load_vector("bitestream/every_type");
  const Reader reader(bytes);
  for (std::uint32_t key = 16; key <= 27; ++key) {
    const auto array = reader.find(key);
    ASSERT_TRUE(array) << key;
    EXPECT_EQ(array->count(), 2u) << key;
    EXPECT_FALSE(array->element(2)) << key;
    EXPECT_FALSE(array->as<double>()) << key;
  }
  EXPECT_EQ(reader.find(16)->element(0)->as_bool(), true);
  EXPECT_EQ(reader.find(16)->element(1)->as_bool(), false);
  for (std::uint32_t key = 17; key <= 20; ++key)
    EXPECT_EQ(reader.find(key)->element(1)->as<int>(), 2);
  for (std::uint32_t key = 21; key <= 24; ++key)
    EXPECT_EQ(reader.find(key)->element(0)->as<int>(), -1);
  EXPECT_EQ(reader.find(25)->element(1)->as<double>(), -2.0);
  EXPECT_EQ(reader.find(26)->element(0)->as<float>(), 0.5f);
  EXPECT_EQ(reader.find(27)->element(1)->as_time(), 1);
  EXPECT_EQ(reader.find(1)->count(), 0u);
  EXPECT_FALSE(reader.find(1)->element(0));
}

TEST(BitestreamReader, ConvertsNumbersAndNothingElse) {
  const auto bytes = load_vector("bitestream/every_type");
  const Reader reader(bytes);
  EXPECT_EQ(reader.find(3)->as<double>(), 200.0);
  EXPECT_EQ(reader.find(11)->as<double>(), 1.5);
  EXPECT_EQ(reader.find(11)->as<int>(), std::nullopt);
  EXPECT_EQ(reader.find(12)->as<float>(), std::nullopt);
  EXPECT_EQ(reader.find(7)->as<std::uint8_t>(), std::nullopt);
  EXPECT_EQ(reader.find(2)->as<int>(), std::nullopt) << "a bool is no number";
  EXPECT_EQ(reader.find(14)->as<std::int64_t>(), std::nullopt) << "a time is no number";
  EXPECT_EQ(reader.find(10)->as_time(), std::nullopt);
  EXPECT_EQ(reader.find(3)->as_bool(), std::nullopt);
  EXPECT_EQ(reader.find(1)->as_text(), std::nullopt);
  EXPECT_EQ(reader.find(13)->as_opaque(), std::nullopt);
  EXPECT_FALSE(reader.find(13)->as_nested());
}

TEST(BitestreamReader, FindsTheFirstOfRepeatedKeysWhereverItStands) {
  Writer writer;
  writer.put_u8(1, 1);
  writer.put_u8("1", 2);
  writer.put_u8(1, 3);
  Reader reader(writer.bytes());
  while (reader.next()) {
  }
  EXPECT_EQ(reader.find(1)->as<int>(), 1);
  EXPECT_EQ(reader.find("1")->as<int>(), 2);
  EXPECT_FALSE(reader.find(2));
  EXPECT_FALSE(reader.find("2"));
}

TEST(BitestreamReader, TakesAnyLengthField) {
  for (const char* hex : {"10 010000 01 05", "11 010000 0100 05", "12 010000 01000000 05"}) {
    const auto bytes = from_hex(hex);
    EXPECT_EQ(Reader(bytes).find(1)->as<int>(), 5) << hex;
  }
}

TEST(BitestreamReader, RefusesHostileBytes) {
  const std::vector<std::string> hostile = {
      "13 010000 01 05",              // length field 3
      "78 010000 01 05",              // type 15
      "80 010000 01 05",              // type 16
      "e0 010000 01 05",              // type 28
      "f0 010000 01 05",              // type 30
      "f8 010000 01 05",              // type 31
      "10 010000 00",                 // length 0
      "10 010000 02 05 05",           // a u8 of 2 bytes
      "20 010000 03 05 05 05",        // a u32 of 3 bytes
      "a0 010000 05 05 05 05 05 05",  // an array of u32 of 5 bytes
      "14 00 01 05",                  // an empty text key
      "14 01 ff 01 05",               // a key that is not UTF-8
      "08 010000 01 02",              // a bool of 2
      "02 010000 01000040 00",        // 2^30 + 1 bytes
      "02 010000 ffffffff 00",        // 2^32 - 1 bytes
      "10 0100",                      // cut in the key
      "14 05 61 62",                  // cut in a text key
      "12 010000 010000",             // cut in the length
      "20 010000 04 05 05 05",        // cut in the value
  };
  for (const auto& hex : hostile) {
    const auto bytes = from_hex(hex);
    Reader reader(bytes);
    EXPECT_FALSE(reader.next()) << hex;
    EXPECT_TRUE(reader.failed()) << hex;
    EXPECT_FALSE(reader.next()) << hex;
    EXPECT_FALSE(reader.find(2)) << hex;
    EXPECT_FALSE(is_valid(bytes)) << hex;
  }
}

TEST(BitestreamReader, GivesWhatStandsBeforeTheFault) {
  const auto bytes = from_hex("10 010000 01 05  10 020000 00");
  Reader reader(bytes);
  EXPECT_TRUE(reader.next());
  EXPECT_FALSE(reader.next());
  EXPECT_TRUE(reader.failed());
  EXPECT_EQ(reader.find(1)->as<int>(), 5);
}

TEST(BitestreamReader, LooksIntoTextAndArraysOnlyWhenAsked) {
  const auto text = from_hex("60 010000 01 ff");
  EXPECT_TRUE(Reader(text).next());
  EXPECT_EQ(Reader(text).next()->as_text(), std::nullopt);
  EXPECT_FALSE(is_valid(text));
  const auto bools = from_hex("88 010000 02 01 02");
  EXPECT_EQ(Reader(bools).next()->element(0)->as_bool(), true);
  EXPECT_EQ(Reader(bools).next()->element(1)->as_bool(), std::nullopt);
  EXPECT_FALSE(is_valid(bools));
}

TEST(BitestreamReader, BoundsNesting) {
  const auto deepest = load_vector("bitestream/nested_16_deep");
  EXPECT_TRUE(is_valid(deepest));
  auto reader = std::optional(Reader(deepest));
  for (int depth = 0; depth < 16; ++depth) {
    const auto value = reader->next();
    ASSERT_TRUE(value) << depth;
    reader = value->as_nested();
  }
  EXPECT_EQ(reader->next()->as<int>(), 1);

  const auto deeper = load_vector("bitestream/nested_17_deep");
  EXPECT_FALSE(is_valid(deeper));
  reader = Reader(deeper);
  for (int depth = 0; depth < 16; ++depth) reader = reader->next()->as_nested();
  EXPECT_FALSE(reader->next());
  EXPECT_TRUE(reader->failed());
}

TEST(BitestreamReader, RefusesABombInOnePass) {
  // 64 KiB of heads, each of a nested stream that claims all the rest.
  Bytes bomb(65'536);
  for (std::size_t at = 0; at + 6 < bomb.size(); at += 6) {
    const auto rest = static_cast<std::uint16_t>(bomb.size() - at - 6);
    const auto head = from_hex("71 010000");
    std::copy(head.begin(), head.end(), bomb.begin() + static_cast<std::ptrdiff_t>(at));
    bomb[at + 4] = static_cast<std::byte>(rest & 0xFF);
    bomb[at + 5] = static_cast<std::byte>(rest >> 8);
  }
  EXPECT_FALSE(is_valid(bomb));
}

TEST(BitestreamReader, ReadsNothingOfNothing) {
  Reader reader;
  EXPECT_FALSE(reader.next());
  EXPECT_FALSE(reader.failed());
  EXPECT_TRUE(is_valid({}));
}

TEST(BitestreamReader, TakesALengthFieldOfEverySize) {
  const auto bytes = load_vector("bitestream/length_fields");
  Reader reader(bytes);
  for (int i = 0; i < 3; ++i) {
    const auto value = reader.next();
    ASSERT_TRUE(value) << i;
    EXPECT_EQ(value->as<std::uint8_t>(), 7) << i;
  }
  EXPECT_FALSE(reader.next());
  EXPECT_FALSE(reader.failed());
}

TEST(BitestreamReader, RefusesEveryCutOfEveryVector) {
  for (const std::string name : {"bitestream/example", "bitestream/every_type",
                                 "bitestream/length_fields", "bitestream/long_text"}) {
    const auto bytes = load_vector(name);
    std::vector<std::size_t> ends{0};
    Reader whole(bytes);
    while (const auto value = whole.next()) {
      ends.push_back(static_cast<std::size_t>(value->bytes().data() - bytes.data()) +
                     value->bytes().size());
    }
    for (std::size_t size = 0; size < bytes.size(); ++size) {
      const bool between_values = std::find(ends.begin(), ends.end(), size) != ends.end();
      EXPECT_EQ(is_valid(std::span<const std::byte>(bytes).first(size)), between_values)
          << name << " at " << size;
    }
  }
}

}  // namespace
}  // namespace gimnet::proto::bitestream
