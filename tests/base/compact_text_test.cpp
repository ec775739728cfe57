#include "base/compact_text.hpp"

#include <gtest/gtest.h>

#include <utility>

namespace gimnet {
namespace {

TEST(CompactText, TakesOneWord) { EXPECT_EQ(sizeof(CompactText), sizeof(void*)); }

TEST(CompactText, IsEmptyUntilItIsSet) {
  CompactText text;
  EXPECT_TRUE(text.empty());
  EXPECT_EQ(text, "");
  EXPECT_EQ(text.str(), "");
  text = "";
  EXPECT_TRUE(text.empty());
}

TEST(CompactText, HoldsWhatItWasSetTo) {
  for (const std::size_t size : {1u, 3u, 15u, 16u, 255u, 256u, 65'536u}) {
    const std::string value(size, 'x');
    const CompactText text = value;
    EXPECT_FALSE(text.empty());
    EXPECT_EQ(text.str(), value);
  }
}

TEST(CompactText, KeepsBytesThatEndOtherTexts) {
  const std::string value("a\0b", 3);
  EXPECT_EQ(CompactText(value).str(), value);
}

TEST(CompactText, IsCopiedMovedAndSetToItself) {
  CompactText first = "robot";
  const CompactText copy = first;
  EXPECT_EQ(copy, first);
  first = std::string_view{first}.substr(1);
  EXPECT_EQ(first, "obot");
  EXPECT_EQ(copy, "robot");
  const CompactText& same = first;
  first = same;
  EXPECT_EQ(first, "obot");
  const CompactText moved = std::move(first);
  EXPECT_EQ(moved, "obot");
  const CompactText longer = "obots";
  EXPECT_FALSE(moved == longer);
}

}  // namespace
}  // namespace gimnet
