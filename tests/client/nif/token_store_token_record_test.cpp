#include "client/nif/token_store.hpp"

#include <gtest/gtest.h>

#include <set>

#include "proto/control/link.hpp"

namespace gimnet::nif::test {
namespace {

TokenRecord some_record() {
  return {"tcp://127.0.0.1:7450", "robot1/base", std::vector<std::byte>(56, std::byte{0x42})};
}

TEST(TokenRecord, IsReadAsItWasWritten) {
  const auto bytes = write_token_record(some_record());
  ASSERT_TRUE(bytes);
  EXPECT_EQ(read_token_record(*bytes), some_record());
}

TEST(TokenRecord, HoldsTheLongestOfEverythingAndNotMore) {
  TokenRecord record{std::string(300, 'a'), std::string(255, 'n'),
                     std::vector<std::byte>(proto::kTokenBytesMax, std::byte{1})};
  EXPECT_EQ(read_token_record(write_token_record(record).value()), record);
  record.address = std::string(kTokenRecordBytesMax - 16 - 255 - proto::kTokenBytesMax, 'a');
  ASSERT_TRUE(write_token_record(record));
  EXPECT_EQ(write_token_record(record)->size(), kTokenRecordBytesMax);
  record.address += 'a';
  EXPECT_FALSE(write_token_record(record));
  record = some_record();
  record.token.clear();
  EXPECT_FALSE(write_token_record(record));
  record.token.resize(proto::kTokenBytesMax + 1);
  EXPECT_FALSE(write_token_record(record));
}

TEST(TokenRecord, WhatIsCutOrLongerOrSomethingElseIsNone) {
  const std::vector<std::byte> bytes = write_token_record(some_record()).value();
  for (std::size_t size = 0; size < bytes.size(); ++size) {
    EXPECT_FALSE(read_token_record(std::span{bytes}.first(size))) << size;
  }
  std::vector<std::byte> other = bytes;
  other.push_back(std::byte{});
  EXPECT_FALSE(read_token_record(other));
  for (std::size_t i = 0; i < 16; ++i) {  // magic, version and sizes: each bit counts
    other = bytes;
    other[i] ^= std::byte{1};
    EXPECT_FALSE(read_token_record(other)) << i;
  }
  EXPECT_FALSE(read_token_record(std::vector<std::byte>(kTokenRecordBytesMax + 1)));
}

TEST(TokenRecord, FileNamesAreReadableAndSafe) {
  const std::string name = token_file_name("tcp://127.0.0.1:7450", "robot1/base");
  EXPECT_TRUE(name.starts_with("robot1_base.")) << name;
  for (const char* const hostile : {"..", "../../etc/passwd", "/", ".", "a\nb", "%s%n", ""}) {
    const std::string made = token_file_name(hostile, hostile);
    EXPECT_EQ(made.find('/'), std::string::npos);
    EXPECT_FALSE(made.starts_with("..")) << made;
  }
  EXPECT_LE(token_file_name(std::string(300, 'x'), std::string(255, 'x')).size(), 80u);
}

TEST(TokenRecord, FileNamesDifferByAddressAndByName) {
  std::set<std::string> names;
  for (const char* const address : {"tcp://h:1", "tcp://h:12", "unix:/a", ""}) {
    for (const char* const name : {"n", "2n", "a/b", "a_b", ""})
      names.insert(token_file_name(address, name));
  }
  EXPECT_EQ(names.size(), 20u);
}

}  // namespace
}  // namespace gimnet::nif::test
