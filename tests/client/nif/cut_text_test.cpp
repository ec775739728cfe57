#include "client/nif/error.hpp"

#include <gtest/gtest.h>

#include <string>

namespace gimnet::nif {
namespace {

TEST(CutText, LeavesWhatFits) {
  EXPECT_EQ(cut_text("", 0), "");
  EXPECT_EQ(cut_text("four", 4), "four");
  EXPECT_EQ(cut_text("f\xC3\xBCnf", 5), "f\xC3\xBCnf");
}

TEST(CutText, CutsBetweenCharacters) {
  EXPECT_EQ(cut_text("fours", 4), "four");
  const std::string text = "a\xC3\xBC\xE2\x82\xAC\xF0\x9F\xA4\x96z";  // of 1, 2, 3, 4 and 1 bytes
  const std::size_t ends[] = {0, 1, 1, 3, 3, 3, 6, 6, 6, 6, 10, 11};
  for (std::size_t most = 0; most < std::size(ends); ++most)
    EXPECT_EQ(cut_text(text, most).size(), ends[most]) << most;
}

TEST(CutText, LeavesAlmostAllOfWhatIsNoUtf8) {
  EXPECT_EQ(cut_text(std::string(100, '\x80'), 50).size(), 47u);
}

}  // namespace
}  // namespace gimnet::nif
