#include "base/result.hpp"

#include <gtest/gtest.h>

#include <memory>
#include <string>
#include <utility>

namespace gimnet {
namespace {

Result<int> half(int number) {
  if (number % 2 != 0) return Error{std::to_string(number) + " is odd"};
  return number / 2;
}

TEST(Result, HasAValueOrAReason) {
  const auto two = half(4);
  ASSERT_TRUE(two);
  EXPECT_EQ(*two, 2);
  const auto none = half(3);
  ASSERT_FALSE(none);
  EXPECT_EQ(none.error().sentence, "3 is odd");
}

TEST(Result, CarriesWhatCannotBeCopied) {
  Result<std::unique_ptr<int>> result(std::make_unique<int>(7));
  const std::unique_ptr<int> taken = std::move(*result);
  EXPECT_EQ(*taken, 7);
}

TEST(ResultDeathTest, AbortsWhereTheSideIsNotThere) {
  EXPECT_DEATH(static_cast<void>(half(3).value()), "broken invariant");
  EXPECT_DEATH(static_cast<void>(half(4).error()), "broken invariant");
}

}  // namespace
}  // namespace gimnet
