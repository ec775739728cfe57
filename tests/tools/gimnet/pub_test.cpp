#include "tools/gimnet/pub.hpp"

#include <gtest/gtest.h>

namespace gimnet::tool {
namespace {

class UnheardLinesTest : public testing::Test {
 protected:
  void publish(std::size_t before, std::size_t after) {
    lines_.before_line(before);
    lines_.after_line(after);
  }
  [[nodiscard]] std::string said() const { return lines_.sentence("r/s", false); }

  UnheardLines lines_;
};

const char* const kWhy =
    " went to nobody: nobody had subscribed to r/s then; --wait 1 holds the first until somebody "
    "has";

TEST_F(UnheardLinesTest, WithoutLinesThereIsNothingToSay) { EXPECT_EQ(said(), ""); }

TEST_F(UnheardLinesTest, AllOfThem) {
  publish(0, 0);
  EXPECT_EQ(said(), std::string("the line") + kWhy);
  publish(0, 0);
  EXPECT_EQ(said(), std::string("all 2 lines") + kWhy);
}

TEST_F(UnheardLinesTest, SomeOfThem) {
  publish(0, 0);
  publish(0, 1);
  publish(1, 1);
  publish(1, 0);
  publish(0, 0);
  EXPECT_EQ(said(), std::string("2 of 5 lines") + kWhy);
}

TEST_F(UnheardLinesTest, AfterAWaitTheLastSubscriberHadLeft) {
  publish(1, 1);
  publish(0, 0);
  EXPECT_EQ(lines_.sentence("r/s", true),
            "1 of 2 lines went to nobody: the last subscriber of r/s had left");
}

TEST_F(UnheardLinesTest, WhomSomebodyMayHaveHeardIsNotAmongThem) {
  publish(0, 1);
  publish(1, 0);
  EXPECT_EQ(said(), "");
}

}  // namespace
}  // namespace gimnet::tool
