#include "tools/gimnet/exit_code.hpp"

#include <gtest/gtest.h>

namespace gimnet::tool {
namespace {

TEST(ExitCode, TermsOutOfRangeAreWrongArgumentsAndAFullTableIsNot) {
  // The bad_request of a hub reaches the program as bad_argument, a full table as limit.
  EXPECT_EQ(exit_code_of(Status::bad_argument), ExitCode::usage);
  EXPECT_EQ(exit_code_of(Status::limit), ExitCode::failed);
}

}  // namespace
}  // namespace gimnet::tool
