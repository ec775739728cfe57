#include "proto/control/fields.hpp"

#include <gtest/gtest.h>

#include <string>

#include "tests/vectors/vector_file.hpp"

namespace gimnet::proto {
namespace {

using bitestream::Writer;
using test::to_bytes;

TEST(Fields, GiveValuesAndFallbacks) {
  Writer body;
  body.put_u8(1, 7);
  body.put_text(2, "robot");
  body.put_bool(3, true);
  body.put_time(4, -5);
  body.put_opaque(5, to_bytes("ab"));
  Fields fields(body.bytes(), "TEST");
  EXPECT_EQ(fields.number<std::uint32_t>(1, "number", 0), 7u);
  EXPECT_EQ(fields.number<std::uint32_t>(9, "number", 12), 12u);
  EXPECT_EQ(fields.text(2, "name", 255), "robot");
  EXPECT_EQ(fields.text(9, "name", 255), "");
  EXPECT_TRUE(fields.flag(3, "flag", false));
  EXPECT_TRUE(fields.flag(9, "flag", true));
  EXPECT_EQ(fields.time(4, "time"), -5);
  EXPECT_EQ(fields.opaque(5, "token", 2), to_bytes("ab"));
  EXPECT_TRUE(fields.has(1) && !fields.has(9));
  EXPECT_FALSE(fields.failed());
}

TEST(Fields, TakeTheFirstOfRepeatedKeysAndSkipUnknownOnes) {
  Writer body;
  body.put_u8("text", 1);
  body.put_u8(Fields::kKeysEnd, 2);
  body.put_u8(BITESTREAM_KEY_NUMBER_MAX, 3);
  body.put_u8(1, 4);
  body.put_u8(1, 5);
  Fields fields(body.bytes(), "TEST");
  EXPECT_EQ(fields.required_number<int>(1, "number"), 4);
  EXPECT_FALSE(fields.failed());
}

TEST(Fields, SayWhatIsWrong) {
  Writer body;
  body.put_u16(1, 300);
  body.put_text(2, "robot");
  const auto sentence = [&body](auto read) {
    Fields fields(body.bytes(), "TEST");
    static_cast<void>(read(fields));
    return fields.failed() ? fields.error().sentence : "";
  };
  EXPECT_EQ(sentence([](Fields& f) { return f.number<std::uint8_t>(1, "role", 0); }),
            "TEST has a role that is not a number that fits");
  EXPECT_EQ(sentence([](Fields& f) { return f.required_number<int>(3, "node id"); }),
            "TEST has no node id (key 3)");
  EXPECT_EQ(sentence([](Fields& f) { return f.text(1, "name", 9); }),
            "TEST has a name that is not text");
  EXPECT_EQ(sentence([](Fields& f) { return f.text(2, "name", 5); }), "");
  EXPECT_EQ(sentence([](Fields& f) { return f.text(2, "name", 4); }),
            "TEST has a name of 5 bytes; at most 4 are allowed");
  EXPECT_EQ(sentence([](Fields& f) { return f.flag(1, "flag", false); }),
            "TEST has a flag that is not a bool");
  EXPECT_EQ(sentence([](Fields& f) { return f.time(1, "time"); }),
            "TEST has a time that is not a time");
  EXPECT_EQ(sentence([](Fields& f) { return f.opaque(1, "token", 9); }),
            "TEST has a token that is not opaque");
}

TEST(Fields, KeepTheFirstFaultAndGiveFallbacksAfterIt) {
  Writer body;
  body.put_u8(1, 7);
  Fields fields(body.bytes(), "TEST");
  EXPECT_EQ(fields.text(1, "name", 9), "");
  EXPECT_EQ(fields.number<int>(1, "number", -1), -1);
  EXPECT_EQ(fields.required_number<int>(2, "other"), 0);
  EXPECT_EQ(fields.error().sentence, "TEST has a name that is not text");
}

TEST(Fields, RefuseABodyThatIsNotABitestream) {
  const auto body = test::from_hex("10 010000 01 07  10 02");
  Fields fields(body, "TEST");
  ASSERT_TRUE(fields.failed());
  EXPECT_EQ(fields.error().sentence, "TEST is not a valid Bitestream");
  EXPECT_EQ(fields.number<int>(1, "number", -1), -1);
}

TEST(Fields, ReadRecordsInOrder) {
  Writer body;
  for (std::uint8_t i = 1; i <= 3; ++i) {
    body.begin_nested(3);
    body.put_u8(1, i);
    body.end_nested();
    body.put_u8(4, 9);
  }
  Fields fields(body.bytes(), "TEST");
  const auto records = fields.records<int>(
      3, "record", [](Fields& record) { return record.required_number<int>(1, "number"); });
  EXPECT_EQ(records, (std::vector<int>{1, 2, 3}));
}

TEST(Fields, TakeAFaultFromARecord) {
  Writer body;
  body.begin_nested(3);
  body.put_u8(2, 1);
  body.end_nested();
  Fields fields(body.bytes(), "TEST");
  static_cast<void>(fields.records<int>(
      3, "record", [](Fields& record) { return record.required_number<int>(1, "number"); }));
  ASSERT_TRUE(fields.failed());
  EXPECT_EQ(fields.error().sentence, "TEST has no number (key 1)");
}

std::string clean(std::string_view text, std::size_t bytes_max) {
  Writer writer;
  put_clean_text(writer, 1, text, bytes_max);
  EXPECT_EQ(writer.finish(), BITESTREAM_OK);
  const auto value = bitestream::Reader(writer.bytes()).find(1);
  return value ? std::string(*value->as_text()) : std::string();
}

TEST(CleanText, IsCutBetweenCharacters) {
  EXPECT_EQ(clean("robot", 5), "robot");
  EXPECT_EQ(clean("robot", 4), "robo");
  EXPECT_EQ(clean("a\u20acb", 3), "a");
  EXPECT_EQ(clean("a\u20acb", 4), "a\u20ac");
  EXPECT_EQ(clean("", 4), "");
}

TEST(CleanText, HasAQuestionMarkForEachByteThatIsNotUtf8) {
  EXPECT_EQ(clean("a\xFF\xC3z", 99), "a??z");
  EXPECT_EQ(clean("\xE2\x82", 99), "??");
}

}  // namespace
}  // namespace gimnet::proto
