#include "proto/bitestream/utf8.hpp"

#include <gtest/gtest.h>

#include <string_view>

namespace gimnet::proto::bitestream {
namespace {

bool valid(std::string_view text) {
  return valid_utf8(reinterpret_cast<const unsigned char*>(text.data()), text.size());
}

TEST(Utf8, AcceptsTheFirstAndLastOfEachLength) {
  for (const char* text :
       {"", "robot", "\x7F", "\xC2\x80", "\xDF\xBF", "\xE0\xA0\x80", "\xED\x9F\xBF", "\xEE\x80\x80",
        "\xEF\xBF\xBF", "\xF0\x90\x80\x80", "\xF4\x8F\xBF\xBF"}) {
    EXPECT_TRUE(valid(text)) << text;
  }
  EXPECT_TRUE(valid(std::string_view("\0", 1)));
}

TEST(Utf8, RefusesOverlongFormsSurrogatesAndWhatIsTooHigh) {
  for (const char* text :
       {"\xC0\x80", "\xC1\xBF", "\xE0\x9F\xBF", "\xF0\x8F\xBF\xBF", "\xED\xA0\x80", "\xED\xBF\xBF",
        "\xF4\x90\x80\x80", "\xF5\x80\x80\x80", "\xFF"}) {
    EXPECT_FALSE(valid(text));
  }
}

TEST(Utf8, RefusesWhatIsCutOrHasNoBeginning) {
  for (const char* text : {"\x80", "a\xBF", "\xC2", "\xC2 ", "\xE2\x82", "\xE2\x82 ",
                           "\xF0\x90\x80", "\xF0\x90\x80 "}) {
    EXPECT_FALSE(valid(text));
  }
}

}  // namespace
}  // namespace gimnet::proto::bitestream
