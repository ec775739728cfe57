#include "gimnet/gimi/outcome.hpp"

#include <gtest/gtest.h>

#include "tests/client/gimi/support/without_exceptions.hpp"

namespace gimnet {
namespace {

// A plugin may be compiled without exceptions, and its program with them: each has its own answer.
TEST(OutcomeDeathTest, CodeWithExceptionsAndWithoutAreOneProgram) {
  Outcome<int> outcome = Failure{Status::timeout, "there is no value"};
  EXPECT_THROW(static_cast<void>(outcome.value()), GimnetError);
  EXPECT_EQ(test::value_without_exceptions(true), 5);
  EXPECT_DEATH(static_cast<void>(test::value_without_exceptions(false)), "there is no value");
}

}  // namespace
}  // namespace gimnet
